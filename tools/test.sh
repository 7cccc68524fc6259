#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test.
#
#   tools/test.sh [CTEST OPTIONS]      e.g. tools/test.sh -R edt
#
# With SIDESTEP_SANITIZERS=1, two further builds come first: every unit test under
# AddressSanitizer and UndefinedBehaviorSanitizer, and those that use threads under
# ThreadSanitizer.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [ "${SIDESTEP_SANITIZERS:-0}" = 1 ]; then
  tools/build.sh asan
  ctest --preset asan -j2 -E '^(benchmark|consumer|style|layers)\.'
  tools/build.sh tsan sidestep_thread_tests
  # Without the long sequences, which take twenty times as long and say nothing more of threads.
  ctest --preset tsan -j2 -L threads \
    -E 'Kitchen|TsdfIntegrators|Thousands|Increments|EqualsAFull|BruteForceWhile'
fi
tools/build.sh release
ctest --preset release -j2 "$@"
