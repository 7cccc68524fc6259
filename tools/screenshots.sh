#!/usr/bin/env bash
# Makes the pictures of the viewer in docs/images: the closed loops of configs/replan, recorded and shown half way, or
# from beginning to end (`film_SCENARIO`), and the sphere editor (`spheres`). Needs a release build with the viewer's
# page, Chromium, and ffmpeg for films (tools/install_deps.sh --dev).
#
#   tools/screenshots.sh [PICTURE...]     e.g. tools/screenshots.sh shelf_pickup film_shelf_pickup
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scenarios=("$@")
[ ${#scenarios[@]} -gt 0 ] ||
  scenarios=({,film_}{floor_pickup,shelf_pickup,table_pickup,room_navigation,arm_reach} spheres)
for scenario in "${scenarios[@]}"; do
  if [ "$scenario" = spheres ]; then
    tools/viewer/page/show_spheres.sh build/release/bin/sidestep \
      build/release/tools/viewer/page/workshop robots/hsr arm_flex_link docs/images/spheres_hsr.png
    echo docs/images/spheres_hsr.png
    continue
  fi
  if [[ $scenario = film_* ]]; then
    frames=$(mktemp -d)
    tools/viewer/page/show_recording.sh build/release/bin/sidestep build/release/tools/viewer/page/workshop \
      "configs/replan/${scenario#film_}.yaml" "$frames/page.png" 0.02 0.98 60
    ffmpeg -loglevel error -y -framerate 8 -i "$frames/page.png.%03d.png" -vf scale=600:-2:flags=lanczos \
      -c:v libwebp_anim -loop 0 -quality 55 -compression_level 6 "docs/images/$scenario.webp"
    rm -r "$frames"
    echo "docs/images/$scenario.webp"
    continue
  fi
  tools/viewer/page/show_recording.sh build/release/bin/sidestep \
    build/release/tools/viewer/page/workshop "configs/replan/$scenario.yaml" \
    "docs/images/viewer_$scenario.png"
  echo "docs/images/viewer_$scenario.png"
done
