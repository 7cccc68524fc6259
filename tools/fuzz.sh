#!/usr/bin/env bash
# Runs the targets of tests/fuzz with libFuzzer, AddressSanitizer and UndefinedBehaviorSanitizer, in build/fuzz.
#
#   tools/fuzz.sh [SECONDS_EACH] [PARSER...]     e.g. tools/fuzz.sh 3600 urdf pcd; 60 s of every one without
#
# Builds what is asked for alone. Corpora grow in build/fuzz/corpus/PARSER; an input that fails is written to
# build/fuzz/findings/PARSER. Ends with 1 where there is such an input. A finding becomes a test: its input, as small as
# it can be made, goes to tests/fuzz/corpus/PARSER.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

seconds=60
if [[ ${1:-} =~ ^[0-9]+$ ]]; then
  seconds=$1
  shift
fi
command -v clang++ >/dev/null || tools/install_deps.sh --dev
cmake --preset fuzz -Wno-dev >/dev/null
targets=("${@/#/fuzz_}")
if [ ${#targets[@]} -eq 0 ]; then
  mapfile -t targets < <(cd build/fuzz/seeds && ls)
fi
cmake --build build/fuzz --target "${targets[@]}"

export TMPDIR=/dev/shm
[ -d "$TMPDIR" ] || TMPDIR=/tmp
export UBSAN_OPTIONS=print_stacktrace=1
export LSAN_OPTIONS=suppressions=$PWD/tests/leaks_of_libraries.supp:print_suppressions=0
found=0
for target in "${targets[@]}"; do
  parser=${target#fuzz_}
  corpus=build/fuzz/corpus/$parser findings=build/fuzz/findings/$parser log=build/fuzz/$target.log
  mkdir -p "$corpus" "$findings"
  while read -r seed; do
    [ -z "$seed" ] || cp "$seed" "$corpus/$(sha1sum <"$seed" | cut -d' ' -f1)"
  done <"build/fuzz/seeds/$target"
  # What sanitizers slow down may take ten times as long as in a release.
  if build/fuzz/bin/"$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=4096 -max_len=65536 \
    -artifact_prefix="$findings/" "$corpus" >/dev/null 2>"$log"; then
    echo "$parser: $(grep -E '^Done' "$log" || tail -n 1 "$log")"
  else
    echo "$parser: FOUND: $(grep -m 1 -E 'not so|ERROR:|runtime error|terminate' "$log" || tail -n 1 "$log")"
    ls -t "$findings" | head -n 1 | sed "s|^|  $findings/|"
    found=1
  fi
done
exit $found
