#!/usr/bin/env bash
# Serves the sphere editor on a copy of a profile, and takes a picture of it.
#
#   show_spheres.sh SIDESTEP WORKSHOP ROBOT LINK PICTURE
#
# ROBOT is the folder of a profile, whose spheres on LINK are shown. WORKSHOP is the folder in the
# build tree in which the page was built. Exits with 77 without Chromium.
set -euo pipefail
sidestep=$1 workshop=$2 robot=$3 link=$4
picture=$(realpath -m "$5")

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

cp -r "$robot" "$folder/$(basename "$robot")"
: >"$folder/served"
(cd "$folder" && exec "$sidestep" robot "$(basename "$robot")/profile.yaml" --spheres 2>served) &
server=$!
until grep -q 'viewer: ' "$folder/served"; do
  kill -0 "$server" || { cat "$folder/served" >&2; exit 1; }
  sleep 0.1
done
url=$(sed -n 's/.*viewer: //p' "$folder/served")
(cd "$workshop" && node screenshot_spheres.mjs "$url" "$picture" "$link")
