#!/usr/bin/env bash
# Reads a recording with the npm package @foxglove/rosbag. Exit code 77 where that cannot be had.
#
#   check_foxglove.sh BAG COUNTS FOLDER
#
# COUNTS: what rosbag counted, if it could. FOLDER: where the package is installed.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bag=$1 counts=$2 folder=$3

command -v node >/dev/null && command -v npm >/dev/null || {
  echo "skipped: node and npm are not installed"
  exit 77
}
mkdir -p "$folder"
cp "$here/package.json" "$here/package-lock.json" "$here/check_foxglove.mjs" "$folder"
cd "$folder"
if [ ! -d node_modules/@foxglove/rosbag ] || [ package-lock.json -nt node_modules ]; then
  npm ci --prefer-offline --ignore-scripts --no-audit --no-fund >npm.log 2>&1 || {
    echo "skipped: the package cannot be installed"
    tail -n 5 npm.log
    exit 77
  }
  touch node_modules
fi
node check_foxglove.mjs "$bag" "$counts"
