#!/usr/bin/env bash
# Runs an experiment with one part that throws, in each of the methods that a run calls: the command
# must end with exit code 3 and name the plugin, whoever called it.
#
#   check_faults.sh SIDESTEP PLUGIN_FOLDER WORK [alone]
set -euo pipefail
sidestep=$1 work=$3
export SIDESTEP_PLUGIN_PATH=$2
configuration=$(dirname "${BASH_SOURCE[0]}")/faults.yaml
. "$(dirname "${BASH_SOURCE[0]}")/../support/expect_run.sh"

# throws KIND METHOD
throws() {
  expect 3 "plugin $1 throwing: threw: on fire in $2" "$1.plugin=throwing" "$1.throws_in=$2"
}

mkdir -p "$work"
expect 0 "away"
throws source next
throws source frame_count
throws source scene
throws mapper integrate
throws field attach
throws field update
throws robot link_poses
throws robot sphere_centres
throws robot sphere_jacobians
throws optimiser solve
thrower='experiment.plans.0.costs=[{cost: {plugin: throwing, throws_in: '
expect 3 "plugin cost throwing: threw: on fire in evaluate" optimiser.plugin=gp_ceres \
  "${thrower}evaluate}}]"
expect 3 "plugin cost throwing: threw: on fire in linearise" optimiser.plugin=gp_chain \
  "${thrower}linearise}}]"
# Under a sanitizer there is one process, and nobody is named.
if [ "${4:-}" != alone ]; then
# What ends the process in them names them, too, and leaves what was measured.
# harms KIND METHOD HOW TEXT
harms() {
  expect 3 "plugin $1 throwing: $4" "$1.plugin=throwing" "$1.throws_in=$2:$3"
  sqlite3 "$work/out/results.sqlite" 'SELECT value FROM provenance' >/dev/null || failed=1
  grep -q "plugin $1 throwing: " "$work/out/run.log" || { echo "$*: not in run.log"; failed=1; }
}
crashed="crashed (Segmentation fault)" gave_up="aborted (abort() or an uncaught exception)"
exited="ended the process with exit code 0"
harms source next segv "$crashed"
harms source next abort "$gave_up"
harms source next terminate "$gave_up"
expect 4 "Sidestep: $gave_up, while others were in source throwing" source.plugin=throwing source.throws_in=next:thread
harms source next overflow "$crashed"
harms source next fpe "crashed (Floating point exception)"
harms source next exit "$exited"
harms source next _exit "$exited"
harms source next quick_exit "$exited"
harms source next killed "killed by SIGKILL (out of memory?)"
harms mapper integrate segv "$crashed; the last frame was 0"
harms field update exit "$exited; the last frame was 0"
harms robot sphere_jacobians segv "$crashed; the last frame was 1"
harms robot sphere_jacobians overflow "$crashed; the last frame was 1"
harms optimiser solve abort "$gave_up; the last frame was 1"
harms mapper integrate worker "$crashed; the last frame was 0"
expect 3 "plugin cost throwing: $crashed" optimiser.plugin=gp_chain "${thrower}'linearise:segv'}}]"

# One that hangs is named after the first Ctrl-C, and the second ends it.
# heard TEXT: waits for a line of the log.
heard() {
  for _ in $(seq 300); do
    if grep -qF -- "$1" "$work/log"; then return; fi
    sleep 0.1
  done
  echo "'$1' does not come:"
  cat "$work/log"
  failed=1
}
"$sidestep" run "$configuration" --out "$work/out" --set mapper.plugin=throwing --set mapper.throws_in=integrate:hang \
  >"$work/log" 2>&1 &
hung=$!
heard "hanging in integrate"
kill -INT "$hung"
heard "waiting for plugin mapper throwing; a second Ctrl-C ends at once"
kill -INT "$hung"
code=0
wait "$hung" || code=$?
[ "$code" -eq 130 ] || { echo "exit code $code after a second Ctrl-C"; failed=1; }

# A validation tells what each test came to, and goes on.
# validation KIND METHOD TEXT...: of a plugin that throws or does harm in a method.
validation() {
  local kind=$1 text code=0
  local grid=""
  [ "$kind" != mapper ] || grid=", resolution_m: 0.05, size_vox: [40, 40, 40]"
  printf '%s: {plugin: throwing, throws_in: "%s"%s}\n' "$kind" "$2" "$grid" >"$work/case.yaml"
  "$sidestep" validate "$SIDESTEP_PLUGIN_PATH/throwing_$kind.so" "$work/case.yaml" --timeout_s 5 >"$work/log" 2>&1 || code=$?
  for text in "  ok      Plugin.DocumentsItsParameters" "Failed: " "${@:3}"; do
    grep -qF -- "$text" "$work/log" || { echo "'$text' is not told of $kind $2:"; cat "$work/log"; failed=1; }
  done
  [ "$code" -eq 1 ] || { echo "exit code $code of the validation of $kind $2"; failed=1; }
}
validation mapper integrate "FAILED" "on fire in integrate"
validation mapper integrate:segv "ENDED   MapperConformance." "$crashed"
validation mapper integrate:exit "$exited"
validation robot link_poses:abort "ENDED   RobotConformance.Conforms: $gave_up"
validation cost evaluate "on fire in evaluate"
validation source next:hang "hangs: no end after 5 s"
fi

# What they return instead names them, too.
expect 4 "mapper throwing, frame 0: has seen enough" mapper.plugin=throwing
expect 4 "field throwing: has nothing to say" field.plugin=throwing
expect 4 "optimiser throwing: does not like the problem" optimiser.plugin=throwing
exit $failed
