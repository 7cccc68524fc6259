#!/usr/bin/env bash
# Compares what `sidestep check` says of each case with the messages that stand beside it, and its
# exit code with 2. Where a message lists the mappers, MAPPERS stands for the folders of
# plugins/mappers, sorted: every one of them and nothing else.
#
#   check_messages.sh SIDESTEP
set -euo pipefail
sidestep=$1
cd "$(dirname "${BASH_SOURCE[0]}")/cases"
mappers=$(cd ../../../plugins/mappers && printf '%s\n' */CMakeLists.txt | LC_ALL=C sort |
  sed 's#/.*##' | paste -sd, | sed 's/,/, /g')

failed=0
for case in *.yaml; do
  code=0
  said=$(env -u SIDESTEP_PLUGIN_PATH "$sidestep" check "$case" 2>&1 >/dev/null |
    sed -E -e 's#^    /.*: [0-9]+ libraries#    FOLDER#' \
      -e 's#(this machine has) [0-9]+ MiB#\1 MEMORY#'; exit "${PIPESTATUS[0]}") || code=$?
  if [ "$code" -ne 2 ]; then
    echo "$case: exit code $code, expected 2"
    failed=1
  fi
  if ! diff -u <(sed "s/MAPPERS/$mappers/" "${case%.yaml}.expected") <(printf '%s\n' "$said"); then
    echo "$case: the messages differ"
    failed=1
  fi
done
exit $failed
