#!/usr/bin/env bash
# Makes the pictures of the viewer in docs/images: the closed loops of configs/replan, each recorded
# and shown half way. Needs a release build with the viewer's page, and Chromium.
#
#   tools/screenshots.sh [SCENARIO...]     e.g. tools/screenshots.sh shelf_pickup
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build=build/release
workshop=$build/tools/viewer/page/workshop
scenarios=("$@")
[ ${#scenarios[@]} -gt 0 ] ||
  scenarios=(floor_pickup shelf_pickup table_pickup room_navigation arm_reach)

folder=$(mktemp -d)
server=
cleanup() {
  [ -z "$server" ] || kill "$server" 2>/dev/null || true
  rm -rf "$folder"
}
trap cleanup EXIT

for scenario in "${scenarios[@]}"; do
  "$build/bin/sidestep" run "configs/replan/$scenario.yaml" \
    --record "$folder/$scenario.bag" --out "$folder/$scenario" >/dev/null
  "$build/bin/sidestep" view "$folder/$scenario.bag" 2>"$folder/url" &
  server=$!
  until grep -q 'viewer: ' "$folder/url"; do
    kill -0 "$server"
    sleep 0.1
  done
  url=$(sed -n 's/.*viewer: //p' "$folder/url")
  (cd "$workshop" && node screenshot.mjs "$url" "$OLDPWD/docs/images/viewer_$scenario.png")
  kill "$server"
  wait "$server" || true
  server=
  echo "docs/images/viewer_$scenario.png"
done
