#!/usr/bin/env bash
# Checks the style of the sources: formatting always, clang-tidy on request.
#
#   tools/lint.sh                            clang-format on every C++ file
#   tools/lint.sh --tidy [FILE...]           also clang-tidy, on FILEs or on everything
#   tools/lint.sh --tidy --changed [COMMIT]  on what differs from COMMIT, by default the one before the last
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

mapfile -t files < <(git ls-files '*.cpp' '*.hpp' '*.cu')
clang-format --dry-run --Werror "${files[@]}"
echo "clang-format: ${#files[@]} files are formatted"

[ "${1:-}" = "--tidy" ] || exit 0
shift
sources() {
  git "$@" -- 'framework/*.cpp' 'plugins/*.cpp' 'tools/*.cpp' | grep -v -e '^plugins/template/' -e /tests/ || true
}
if [ "${1:-}" = "--changed" ]; then
  since=${2:-HEAD~1}
  git rev-parse -q --verify "$since^{commit}" >/dev/null || since=HEAD
  mapfile -t files < <(sources diff --name-only --diff-filter=d "$since")
elif [ $# -gt 0 ]; then
  files=("$@")
else
  mapfile -t files < <(sources ls-files)
fi
if [ ${#files[@]} -gt 0 ]; then
  # A build without batches has an entry for each source, and no option that clang refuses.
  cmake --preset debug -B build/tidy -DSIDESTEP_HAS_MOVE_MAX=OFF -DSIDESTEP_TEST_BATCHES=OFF >/dev/null
  printf '%s\n' "${files[@]}" | xargs -P "$(nproc)" -n 2 \
    clang-tidy -p build/tidy --quiet --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-unused-command-line-argument
fi
echo "clang-tidy: ${#files[@]} files are clean"
