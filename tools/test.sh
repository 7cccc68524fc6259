#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test.
#
#   tools/test.sh [CTEST OPTIONS]      e.g. tools/test.sh -R edt
#
# SIDESTEP_SANITIZERS=core runs first, in builds of their own: under AddressSanitizer and
# UndefinedBehaviorSanitizer the tests of what decides whether a robot may move and of what reads files, under
# ThreadSanitizer the unit tests that use threads. SIDESTEP_SANITIZERS=all: every unit test under the former.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${SIDESTEP_SANITIZERS:-}" in
  "") ;;
  core)
    tools/build.sh asan sidestep_safety_tests
    # Without what is compared with dense sampling, which takes minutes.
    ctest --preset asan -j2 --no-tests=error -L safety -E DenseSampling
    ;;&
  all)
    tools/build.sh asan
    ctest --preset asan -j2 --no-tests=error -E '^(benchmark|consumer|style|layers)\.'
    ;;&
  core | all)
    tools/build.sh tsan sidestep_threads_tests
    # Without the long sequences, which take twenty times as long and say nothing more of threads.
    ctest --preset tsan -j2 --no-tests=error -L threads -E 'Kitchen|TsdfIntegrators|Thousands|Increments|EqualsAFull|BruteForceWhile'
    ;;
  *)
    echo "test.sh: SIDESTEP_SANITIZERS is core or all, not '$SIDESTEP_SANITIZERS'" >&2
    exit 2
    ;;
esac
tools/build.sh release
ctest --preset release -j2 "$@"
