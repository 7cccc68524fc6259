#!/usr/bin/env bash
# usage: check_without_ros.sh SIDESTEP SOURCE WORK CXX
set -euo pipefail
sidestep=$1 source=$2 work=$3 cxx=$4

expect() { # expect TEXT FILE
  grep -qF -- "$1" "$2" || { echo "expected '$1' in:"; cat "$2"; exit 1; }
}
expect_code() { # expect_code CODE COMMAND...
  local wanted=$1 code=0
  shift
  "$@" >"$work/said.txt" 2>&1 || code=$?
  [ "$code" -eq "$wanted" ] || { echo "exit code $code, expected $wanted: $*"; cat "$work/said.txt"; exit 1; }
}

rm -rf "$work"
mkdir -p "$work"
cmake -S "$source" -B "$work/build" -G Ninja -DCMAKE_CXX_COMPILER="$cxx" -DSIDESTEP_ROS=OFF -DSIDESTEP_CUDA=OFF \
  -DSIDESTEP_TESTS=OFF -DSIDESTEP_BENCHMARKS=OFF >"$work/configure.log" 2>&1 ||
  { cat "$work/configure.log"; exit 1; }
not_built=$work/build/lib/sidestep/plugins/not_built.txt
expect "source rosbag libroscpp-core-dev libsensor-msgs-dev" "$not_built"
expect "Plugin rosbag is not built: install libroscpp-core-dev" "$work/configure.log"
expect "mapper voxel_grid_cuda cuda-nvcc-13-0 cuda-cudart-dev-13-0" "$not_built"
expect "field edt_cuda cuda-nvcc-13-0 cuda-cudart-dev-13-0" "$not_built"
expect "optimiser gp_chain_cuda cuda-nvcc-13-0 cuda-cudart-dev-13-0" "$not_built"
if grep -qE 'LANGUAGE.*CUDA|\.cu\.o' "$work/build/build.ninja"; then
  echo "something of CUDA is built all the same"
  exit 1
fi
if grep -qE 'source_rosbag|plugins/ros_messages|roscpp' "$work/build/build.ninja"; then
  echo "something of ROS is built all the same"
  exit 1
fi

# The same for a plugin that this build cannot have.
mkdir "$work/plugins"
echo "source sonar libsonar-dev libecho-dev" >"$work/plugins/not_built.txt"
export SIDESTEP_PLUGIN_PATH=$work/plugins
said="'sonar' was not built: \`sudo apt install libsonar-dev libecho-dev\`, then build again"
expect_code 0 "$sidestep" plugins
expect "source     $said" "$work/said.txt"
expect_code 3 "$sidestep" plugins sonar
expect "$said" "$work/said.txt"
expect_code 3 "$sidestep" check "$source/configs/demo.yaml" --set source.plugin=sonar
expect "$said" "$work/said.txt"
