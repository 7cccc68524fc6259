#!/usr/bin/env bash
# Checks the style of the sources: formatting always, clang-tidy on request.
#
#   tools/lint.sh                  clang-format on every C++ file
#   tools/lint.sh --tidy [FILE...] also clang-tidy, on FILEs or on everything; needs a build
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

mapfile -t files < <(git ls-files '*.cpp' '*.hpp' '*.cu')
clang-format --dry-run --Werror "${files[@]}"
echo "clang-format: ${#files[@]} files are formatted"

if [ "${1:-}" = "--tidy" ]; then
  shift
  database=build/release
  [ -f "$database/compile_commands.json" ] || tools/build.sh release
  if [ $# -eq 0 ]; then
    mapfile -t sources < <(git ls-files 'framework/*.cpp' 'plugins/*.cpp' 'tools/*.cpp' |
      grep -v -e '^plugins/template/')
    set -- "${sources[@]}"
  fi
  printf '%s\n' "$@" | xargs -P "$(nproc)" -n 4 \
    clang-tidy -p "$database" --quiet --extra-arg=-Wno-unknown-warning-option
  echo "clang-tidy: $# files are clean"
fi
