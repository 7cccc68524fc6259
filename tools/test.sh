#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test.
#
#   tools/test.sh [CTEST OPTIONS]      e.g. tools/test.sh -R edt
#
# With SIDESTEP_SANITIZERS=1 the tests that matter for them run under AddressSanitizer,
# UndefinedBehaviorSanitizer and ThreadSanitizer first, which takes two further builds.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [ "${SIDESTEP_SANITIZERS:-0}" = 1 ]; then
  for preset in asan tsan; do
    tools/build.sh "$preset"
    ctest --preset "$preset" -j2 -L sanitize
  done
fi
tools/build.sh release
ctest --preset release -j2 "$@"
