#!/usr/bin/env bash
# Makes the pictures of the viewer in docs/images: the closed loops of configs/replan, recorded and
# shown half way, and the sphere editor (`spheres`). Needs a release build with the viewer's page, and Chromium.
#
#   tools/screenshots.sh [SCENARIO...]     e.g. tools/screenshots.sh shelf_pickup
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scenarios=("$@")
[ ${#scenarios[@]} -gt 0 ] ||
  scenarios=(floor_pickup shelf_pickup table_pickup room_navigation arm_reach spheres)
for scenario in "${scenarios[@]}"; do
  if [ "$scenario" = spheres ]; then
    tools/viewer/page/show_spheres.sh build/release/bin/sidestep \
      build/release/tools/viewer/page/workshop robots/hsr arm_flex_link docs/images/spheres_hsr.png
    echo docs/images/spheres_hsr.png
    continue
  fi
  tools/viewer/page/show_recording.sh build/release/bin/sidestep \
    build/release/tools/viewer/page/workshop "configs/replan/$scenario.yaml" \
    "docs/images/viewer_$scenario.png"
  echo "docs/images/viewer_$scenario.png"
done
