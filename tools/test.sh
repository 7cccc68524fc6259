#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test.
#
#   tools/test.sh [CTEST OPTIONS]      e.g. tools/test.sh -R edt
#
# SIDESTEP_SANITIZERS=core runs some of them under sanitizers first, in builds of their own: under AddressSanitizer and
# UndefinedBehaviorSanitizer the tests of what decides whether a robot may move and of what reads files, under
# ThreadSanitizer the unit tests that use threads. SIDESTEP_SANITIZERS=all: every unit test under the former.
# SIDESTEP_SANITIZERS_UNTIL=SECONDS: those whose build would begin later than this, in seconds since 1970, are left
# out, and a line says so.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${SIDESTEP_SANITIZERS:-}" in
  "" | core | all) ;;
  *)
    echo "test.sh: SIDESTEP_SANITIZERS is core or all, not '$SIDESTEP_SANITIZERS'" >&2
    exit 2
    ;;
esac
[[ ${SIDESTEP_SANITIZERS_UNTIL:-0} =~ ^[0-9]+$ ]] || {
  echo "test.sh: SIDESTEP_SANITIZERS_UNTIL is a number of seconds, not '$SIDESTEP_SANITIZERS_UNTIL'" >&2
  exit 2
}

# run_sanitized PRESET TARGET CTEST_OPTION...
run_sanitized() {
  if ((${SIDESTEP_SANITIZERS_UNTIL:-0} && $(date +%s) > SIDESTEP_SANITIZERS_UNTIL)); then
    echo "test.sh: no time is left for the tests under $1" >&2
    return
  fi
  tools/build.sh "$1" "$2"
  ctest --preset "$1" -j2 --no-tests=error "${@:3}"
}

tools/build.sh release
case "${SIDESTEP_SANITIZERS:-}" in
  # Without what is compared with dense sampling, which takes minutes.
  core) run_sanitized asan sidestep_safety_tests -L safety -E DenseSampling ;;&
  all) run_sanitized asan all -E '^(benchmark|consumer|style|layers)\.' ;;&
  core | all)
    # Without the long sequences, which take twenty times as long and say nothing more of threads.
    run_sanitized tsan sidestep_threads_tests -L threads \
      -E 'Kitchen|TsdfIntegrators|Thousands|Increments|EqualsAFull|BruteForceWhile'
    ;;
esac
ctest --preset release -j2 "$@"
