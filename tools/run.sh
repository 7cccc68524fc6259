#!/usr/bin/env bash
# Installs what is missing, builds, and runs `sidestep run`; without arguments, the demo.
#
#   tools/run.sh                                     the demo
#   tools/run.sh CONFIG... [options of sidestep run] any experiment
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/tools/build.sh" release sidestep_product
if [ $# -eq 0 ]; then
  set -- "$root/configs/demo.yaml"
fi
exec "$root/build/release/bin/sidestep" run "$@"
