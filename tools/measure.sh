#!/usr/bin/env bash
# Measures the tables of docs/performance.md on this machine and writes them into the page. Run it while nothing else runs.
#
#   tools/measure.sh [AREA...]     every area, about half an hour, or some: the page's headings name them
#
# Recorded inputs are looked for in ../shared/data or $SIDESTEP_SHARED_DATA; an area that lacks its own is left as it is.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
"$root/tools/build.sh" release
exec node "$root/tools/measure.mjs" "$@"
