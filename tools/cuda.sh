#!/usr/bin/env bash
# Checks and measures what Sidestep does on the GPU of this machine. Needs nvcc, g++, bash and the header
# tl/expected.hpp (Debian: libexpected-dev): no CMake, no other library.
#
#   tools/cuda.sh              builds for this GPU, runs every check; exit code 77: there is no GPU
#   tools/cuda.sh sanitize     the same under compute-sanitizer: memcheck, then racecheck
#   tools/cuda.sh times        measures each stage, and prints a table
#   tools/cuda.sh build        builds only
#
# SIDESTEP_CUDA_ARCH names the architecture to build for (90, say); `native`, the default, needs the GPU.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

command -v nvcc >/dev/null || PATH=$PATH:/usr/local/cuda/bin
command -v nvcc >/dev/null || { echo "cuda.sh: nvcc is not installed" >&2; exit 2; }
arch=${SIDESTEP_CUDA_ARCH:-native}
[ "$arch" = native ] || arch=sm_$arch
out=build/cuda
mkdir -p $out

edt=plugins/fields/edt_cuda
map=plugins/mappers/voxel_grid_cuda
chain=plugins/optimisers/gp_chain_cuda
flags=(-std=c++20 -O3 -lineinfo --fmad=false -arch="$arch" -Xcompiler=-ffp-contract=off
  -Iplugins -Iframework/include -I$edt -I$edt/tests -I$map
  -I$chain -I$chain/tests -Iplugins/optimisers/gp_chain)
objects=()
jobs=()
for source in plugins/cuda/device_backend.cpp plugins/cuda/probe.cu $edt/transform_device.cu $map/map_device.cu $chain/chain_batch_device.cu \
  $edt/transform_host.cpp $map/map_host.cpp $chain/chain_batch_host.cpp \
  tests/cuda/main.cpp tests/cuda/chain_checks.cpp tests/cuda/device_checks.cpp tests/cuda/device_times.cpp; do
  object=$out/$(basename "$source").o
  objects+=("$object")
  nvcc "${flags[@]}" -c "$source" -o "$object" &
  jobs+=($!)
done
for job in "${jobs[@]}"; do wait "$job"; done
nvcc -arch="$arch" "${objects[@]}" -o $out/cuda_check

case ${1:-check} in
  build) ;;
  check) exec $out/cuda_check ;;
  times) exec $out/cuda_check --times ;;
  sanitize)
    for tool in memcheck racecheck; do  # some checks ask for more memory than there is
      compute-sanitizer --tool $tool --report-api-errors no --error-exitcode 1 $out/cuda_check
    done
    ;;
  *) echo "usage: tools/cuda.sh [check|sanitize|times|build]" >&2; exit 2 ;;
esac
