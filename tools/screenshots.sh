#!/usr/bin/env bash
# Makes the pictures of the viewer in docs/images: the closed loops of configs/replan, recorded and
# shown half way, the sphere editor (`spheres`), and the README's moving picture (`moving`). Needs a release
# build with the viewer's page, Chromium, and for the moving picture ImageMagick.
#
#   tools/screenshots.sh [SCENARIO...]     e.g. tools/screenshots.sh shelf_pickup
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scenarios=("$@")
[ ${#scenarios[@]} -gt 0 ] ||
  scenarios=(floor_pickup shelf_pickup table_pickup room_navigation arm_reach spheres moving)
for scenario in "${scenarios[@]}"; do
  if [ "$scenario" = spheres ]; then
    tools/viewer/page/show_spheres.sh build/release/bin/sidestep \
      build/release/tools/viewer/page/workshop robots/hsr arm_flex_link docs/images/spheres_hsr.png
    echo docs/images/spheres_hsr.png
    continue
  fi
  if [ "$scenario" = moving ]; then
    frames=$(mktemp -d)
    tools/viewer/page/show_recording.sh build/release/bin/sidestep build/release/tools/viewer/page/workshop \
      configs/replan/floor_pickup.yaml "$frames/page.png" 0.05 0.75 42
    convert -delay 12 "$frames"/page.png.*.png -resize 480x +dither -colors 32 -layers optimize docs/images/moving.gif
    rm -r "$frames"
    echo docs/images/moving.gif
    continue
  fi
  tools/viewer/page/show_recording.sh build/release/bin/sidestep \
    build/release/tools/viewer/page/workshop "configs/replan/$scenario.yaml" \
    "docs/images/viewer_$scenario.png"
  echo "docs/images/viewer_$scenario.png"
done
