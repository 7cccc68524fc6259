#!/usr/bin/env bash
# Records a run, serves the recording, and takes a picture of the page half way through, or as
# screenshot.mjs is told.
#
#   show_recording.sh SIDESTEP WORKSHOP CONFIG PICTURE [SHARE [UNTIL COUNT]]
#
# WORKSHOP is the folder in the build tree in which the page was built. Exits with 77 without
# Chromium, with 1 where the page complains or shows no recording.
set -euo pipefail
sidestep=$1 workshop=$2 config=$3
picture=$(realpath -m "$4")
. "$(dirname "${BASH_SOURCE[0]}")/serving.sh"

"$sidestep" run "$config" --record "$folder/run.bag" --out "$folder/out" >/dev/null 2>"$folder/log" ||
  [ $? -eq 1 ] || { cat "$folder/log" >&2; exit 1; }  # a robot that does not get there is shown, too
serve "$sidestep" view "$folder/run.bag"
(cd "$workshop" && node screenshot.mjs "$url" "$picture" "${@:5}")
