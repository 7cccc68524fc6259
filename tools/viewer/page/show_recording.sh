#!/usr/bin/env bash
# Records a run, serves the recording, and takes a picture of the page half way through.
#
#   show_recording.sh SIDESTEP WORKSHOP CONFIG PICTURE
#
# WORKSHOP is the folder in the build tree in which the page was built. Exits with 77 without
# Chromium, with 1 where the page complains or shows no recording.
set -euo pipefail
sidestep=$1 workshop=$2 config=$3
picture=$(realpath -m "$4")

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

"$sidestep" run "$config" --record "$folder/run.bag" --out "$folder/out" >/dev/null 2>"$folder/log" ||
  [ $? -eq 1 ] || { cat "$folder/log" >&2; exit 1; }  # a robot that does not get there is shown, too
: >"$folder/served"
"$sidestep" view "$folder/run.bag" 2>"$folder/served" &
server=$!
until grep -q 'viewer: ' "$folder/served"; do
  kill -0 "$server" || { cat "$folder/served" >&2; exit 1; }
  sleep 0.1
done
url=$(sed -n 's/.*viewer: //p' "$folder/served")
(cd "$workshop" && node screenshot.mjs "$url" "$picture")
