#!/usr/bin/env bash
# Runs an experiment with the plugins of the GPU where CUDA sees no device: an error that says so and names
# the way out, or, with fallback cpu, the run goes on.
#
#   check_without_device.sh SIDESTEP WORK
set -euo pipefail
sidestep=$1 work=$2
export CUDA_VISIBLE_DEVICES=  # also where there is a GPU
configuration=$(dirname "${BASH_SOURCE[0]}")/gpu.yaml
. "$(dirname "${BASH_SOURCE[0]}")/../support/expect_run.sh"

mkdir -p "$work"
expect 3 "no CUDA device can be used" mapper.fallback=none
expect 3 "fallback: cpu goes on with the mapper voxel_grid" mapper.fallback=none
expect 3 "no CUDA device can be used" field.fallback=none
expect 3 "fallback: cpu goes on with the field edt" field.fallback=none
expect 0 "mapper voxel_grid_cuda runs as voxel_grid, on the CPU" experiment.seed=1
expect 3 "no CUDA device can be used" optimiser.fallback=none
expect 3 "fallback: cpu goes on with the optimiser gp_chain" optimiser.fallback=none
expect 0 "field edt_cuda goes on as edt, on the CPU" experiment.seed=1
expect 0 "optimiser gp_chain_cuda goes on as gp_chain, on the CPU" experiment.seed=1
exit $failed
