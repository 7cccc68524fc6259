#!/usr/bin/env bash
# Runs an experiment with one part that throws, in each of the methods that a run calls: the command
# must end with exit code 3 and name the plugin, whoever called it.
#
#   check_faults.sh SIDESTEP PLUGIN_FOLDER WORK
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
# What they return instead names them, too.
expect 4 "mapper throwing, frame 0: has seen enough" mapper.plugin=throwing
expect 4 "field throwing: has nothing to say" field.plugin=throwing
expect 4 "optimiser throwing: does not like the problem" optimiser.plugin=throwing
exit $failed
