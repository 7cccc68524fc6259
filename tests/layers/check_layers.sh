#!/usr/bin/env bash
# Fails where a file includes what its place forbids.
#
#   check_layers.sh ROOT
#
#  - Each layer of framework/ includes itself and the layers its line below allows.
#  - Public headers include only the standard library, Eigen, tl::expected and Sidestep's own; those
#    of results and report JSON, too.
#  - Plugins include the SDK, experiments the runtime and what lies on it as well; only a plugin
#    includes its own folder.
#  - No experiment includes another; what two of them share includes neither.
#  - ROS is included by the plugins that speak it, what these share, and the simulated robot, only.
#  - CUDA is included by what its plugins share, only.
set -euo pipefail
cd "$1"

sdk="core geometry sensing field robot mapping trajectory planning plugin"
lab="certificates runtime results report measures problems experiments"
allowed() {
  case $1 in
    core) echo "core" ;;
    geometry) echo "core geometry" ;;
    sensing | field | robot) echo "core geometry $1" ;;
    mapping | trajectory) echo "core geometry sensing field robot $1" ;;
    planning) echo "core geometry sensing field robot mapping trajectory planning" ;;
    plugin | plugins) echo "$sdk" ;;
    shapes) echo "$sdk" ;;
    certificates) echo "$sdk certificates" ;;
    runtime | results) echo "$sdk certificates runtime $1" ;;
    report | measures) echo "$sdk certificates runtime results $1" ;;
    problems) echo "$sdk certificates runtime results measures problems" ;;
    experiments) echo "$sdk $lab" ;;
    protocol) echo "$sdk ${lab% experiments}" ;;
  esac
}

# check_file FILE LAYER PUBLIC
check_file() {
  awk -v file="$1" -v layer="$2" -v public="$3" -v allowed=" $(allowed "$2") " '
    !/^#[ ]*include/ { next }
    match($0, /[<"]sidestep\/[a-z_]+\//) {
      other = substr($0, RSTART + 10, RLENGTH - 11)
      if (index(allowed, " " other " ") == 0)
        printf "%s:%d: %s may not include sidestep/%s/\n", file, NR, layer, other
      next
    }
    /[<"]plugins\// { printf "%s:%d: a plugin is included by its own folder only\n", file, NR; next }
    public && match($0, /<[A-Za-z0-9_]+\//) {
      library = substr($0, RSTART + 1, RLENGTH - 2)
      if (library != "Eigen" && library != "tl" && (library != "nlohmann" || layer !~ /^re(sults|port)$/))
        printf "%s:%d: public headers may not include <%s/...>\n", file, NR, library
    }' "$1"
}

violations=$(
  for layer in $sdk shapes $lab; do
    find "framework/include/sidestep/$layer" -name '*.hpp' 2>/dev/null | sort |
      while read -r file; do check_file "$file" "$layer" 1; done
    find "framework/src/$layer" -name '*.[hc]pp' 2>/dev/null | sort |
      while read -r file; do check_file "$file" "$layer" 0; done
  done
  find plugins -name '*.[hc]pp' -not -path '*/tests/*' -not -path '*/benchmarks/*' -not -name '*_test.cpp' 2>/dev/null | sort |
    while read -r file; do
      case $file in
        plugins/experiments/* | plugins/template/experiment/*) check_file "$file" protocol 0 ;;
        *) check_file "$file" plugins 0 ;;
      esac
    done
  for file in $(find plugins/experiments -name '*.[hc]pp' 2>/dev/null | sort); do
    for header in $(sed -nE 's/^#[ ]*include "(.*)"/\1/p' "$file"); do
      places=("$(dirname "$file")" plugins/experiments/closed_loop plugins/experiments/recorded_solves)
      [ -n "$(find "${places[@]}" -name "$header" 2>/dev/null)" ] ||
        echo "$file: \"$header\" is neither in its folder nor in one that experiments share"
    done
  done
  grep -rnE --include='*.[hc]pp' '^#[ ]*include [<"](ros|rosbag|tf2?|tf2_ros|actionlib|[a-z0-9_]+_msgs)/' \
    framework plugins tools 2>/dev/null |
    grep -vE '^(plugins/(ros_messages|ros1_node|sources/(rosbag|ros1)|executors/ros1)|tools/fake_hsr)/' |
    sed -E 's/^([^:]*:[0-9]+):.*/\1: ROS is for the plugins that speak it only/' || true
  grep -rnE --include='*.[hc]pp' --include='*.cu' '^#[ ]*include [<"](cuda_|cuda[.]h|cooperative_groups|thrust/|cub/)' \
    framework plugins tools 2>/dev/null | grep -v '^plugins/cuda/' |
    sed -E 's/^([^:]*:[0-9]+):.*/\1: CUDA is for plugins\/cuda only/' || true
)
if [ -n "$violations" ]; then
  echo "$violations"
  exit 1
fi
