#!/usr/bin/env bash
# Serves the sphere editor on a copy of a profile, and takes a picture of it.
#
#   show_spheres.sh SIDESTEP WORKSHOP ROBOT LINK PICTURE
#
# ROBOT is the folder of a profile, whose spheres on LINK are shown. WORKSHOP is the folder in the
# build tree in which the page was built. Exits with 77 without Chromium.
set -euo pipefail
sidestep=$(realpath "$1") workshop=$2 robot=$3 link=$4
picture=$(realpath -m "$5")
. "$(dirname "${BASH_SOURCE[0]}")/serving.sh"

name=$(basename "$robot")
cp -r "$robot" "$folder/$name"
from=$PWD
cd "$folder"  # the page says where the profile lies
serve "$sidestep" robot "$name/profile.yaml" --spheres
cd "$from"
(cd "$workshop" && node screenshot_spheres.mjs "$url" "$picture" "$link")
