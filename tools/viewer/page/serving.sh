# Sourced by what takes pictures of served pages: a folder for the time of the script, $folder, and a
# server beside it. Exits with 77 without Chromium or Node.

if [ ! -x /usr/bin/chromium ] || ! command -v node >/dev/null; then
  echo "needs /usr/bin/chromium and node" >&2
  exit 77
fi

folder=$(mktemp -d)
server=
cleanup() {
  if [ -n "$server" ]; then
    kill "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
  fi
  rm -rf "$folder"
}
trap cleanup EXIT

# serve COMMAND...: starts what serves a page until the script ends, and sets $url to its address.
serve() {
  : >"$folder/served"
  "$@" 2>"$folder/served" &
  server=$!
  until grep -q 'viewer: ' "$folder/served"; do
    kill -0 "$server" || { cat "$folder/served" >&2; exit 1; }
    sleep 0.1
  done
  url=$(sed -n 's/.*viewer: //p' "$folder/served")
}
