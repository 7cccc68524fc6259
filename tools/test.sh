#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test.
#
#   tools/test.sh [CTEST OPTIONS]      e.g. tools/test.sh -R edt
#
# SIDESTEP_SANITIZERS=core runs before them, in builds of their own: under AddressSanitizer and
# UndefinedBehaviorSanitizer the tests of what decides whether a robot may move and of what reads files, under
# ThreadSanitizer the unit tests that use threads. SIDESTEP_SANITIZERS=all: every unit test under the former.
# With SIDESTEP_SANITIZERS_BEGIN_WITHIN_S, what would begin later than so many seconds after the start is left out,
# and said.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# begin NAME: whether there is time for the tests under this sanitizer.
begin() {
  ((SECONDS <= ${SIDESTEP_SANITIZERS_BEGIN_WITHIN_S:-SECONDS})) && return
  echo "test.sh: LEFT OUT: the tests under $1, as $SECONDS s have gone by"
  return 1
}

sanitizers=${SIDESTEP_SANITIZERS:-}
if [[ ! $sanitizers =~ ^(core|all)?$ ]]; then
  echo "test.sh: SIDESTEP_SANITIZERS is core or all, not '$sanitizers'" >&2
  exit 2
fi
tools/build.sh release
if [ "$sanitizers" = core ] && begin AddressSanitizer; then
  tools/build.sh asan sidestep_safety_tests
  # Without what is compared with dense sampling, which takes minutes.
  ctest --preset asan -j2 --no-tests=error -L safety -E DenseSampling
elif [ "$sanitizers" = all ] && begin AddressSanitizer; then
  tools/build.sh asan
  ctest --preset asan -j2 --no-tests=error -E '^(benchmark|consumer|style|layers)\.'
fi
if [ -n "$sanitizers" ] && begin ThreadSanitizer; then
  tools/build.sh tsan sidestep_threads_tests
  # Without the long sequences, which take twenty times as long and say nothing more of threads.
  ctest --preset tsan -j2 --no-tests=error -L threads -E 'Kitchen|TsdfIntegrators|Thousands|Increments|EqualsAFull|BruteForceWhile'
fi
ctest --preset release -j2 "$@"
