#!/usr/bin/env bash
# Installs what is missing, then configures and builds one preset.
#
#   tools/build.sh [PRESET [TARGET...]]     PRESET: release (the default), debug, asan or tsan
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
preset=${1:-release}
shift || true
targets=("${@:-all}")

# Reads the lines of a build: "| 12 of 90 | 35.1 | Building ...". Shows how far it is, on a terminal in one line,
# elsewhere a line every half minute.
show_progress() {
  local mark done total elapsed line shown=0
  while read -r mark done _ total _ elapsed _; do
    [[ $mark = "|" && $done -gt 0 ]] || continue
    elapsed=${elapsed%.*}
    line="  $done of $total, about $((elapsed * (total - done) / done)) s left"
    if [ -t 1 ]; then
      printf '\r\033[K%s' "$line"
    elif ((elapsed >= shown + 30)); then
      echo "$line"
      shown=$elapsed
    fi
  done
  [ ! -t 1 ] || printf '\r\033[K'
}

tools/install_deps.sh
log=build/$preset.log
mkdir -p build
echo "Building Sidestep ($preset); the log is $log"
cmake --preset "$preset" >"$log" 2>&1 || { tail -n 40 "$log" >&2; exit 1; }
export NINJA_STATUS='| %f of %t | %e | '
cmake --build --preset "$preset" --target "${targets[@]}" 2>&1 | tee -a "$log" | show_progress || {
  grep -v '^|' "$log" | tail -n 60 >&2
  exit 1
}
