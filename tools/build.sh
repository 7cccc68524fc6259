#!/usr/bin/env bash
# Installs what is missing, then configures and builds one preset.
#
#   tools/build.sh [PRESET [TARGET]]     PRESET: release (the default), debug, asan or tsan
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
preset=${1:-release}
target=${2:-all}

tools/install_deps.sh
log=build/$preset.log
mkdir -p build
echo "Building Sidestep ($preset); the log is $log"
cmake --preset "$preset" >"$log" 2>&1 || { tail -n 40 "$log" >&2; exit 1; }
if [ -t 1 ]; then
  cmake --build --preset "$preset" --target "$target" 2>&1 | tee -a "$log" | while IFS= read -r line; do
    case $line in \[*) printf '\r\033[K%.100s' "$line" ;; esac
  done || { printf '\n'; grep -v '^\[' "$log" | tail -n 60 >&2; exit 1; }
  printf '\r\033[K'
else
  cmake --build --preset "$preset" --target "$target" >>"$log" 2>&1 || { grep -v '^\[' "$log" | tail -n 60 >&2; exit 1; }
fi
