#!/usr/bin/env bash
# usage: check_consumer.sh BUILD SOURCE WORK CXX
set -euo pipefail
build=$1 source=$2 work=$3 cxx=$4

say() { printf '%s\n' "$*"; }
expect() { # expect TEXT FILE
  grep -qF -- "$1" "$2" || { say "expected '$1' in:"; cat "$2"; exit 1; }
}

rm -rf "$work"
mkdir -p "$work"
cmake --install "$build" --prefix "$work/first" >"$work/install.log"
# Moved: nothing may point back to where it was installed or built.
mv "$work/first" "$work/moved"
prefix=$work/moved
sidestep=$prefix/bin/sidestep

# A plugin of every kind, as somebody begins who writes one.
mkdir "$work/new"
kinds=$(cd "$source/plugins/template" && ls -d */ | tr -d /)
[ "$(wc -w <<<"$kinds")" -eq 11 ] || { say "not every kind of plugin has an example: $kinds"; exit 1; }
{
  echo "cmake_minimum_required(VERSION 3.22)"
  echo "project(all LANGUAGES CXX)"
  echo "include(CTest)"
  for kind in $kinds; do echo "add_subdirectory(my_$kind)"; done
} >"$work/new/CMakeLists.txt"
for kind in $kinds; do
  "$sidestep" new "$kind" "my_$kind" --out "$work/new/my_$kind" >"$work/new.txt"
  expect "-DCMAKE_PREFIX_PATH=$prefix" "$work/new.txt"
done
cmake -S "$work/new" -B "$work/plugin" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$cxx" \
  -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Wshadow -Wno-missing-field-initializers -Werror" >"$work/configure.log"
cmake --build "$work/plugin" -j2 >"$work/build.log" 2>&1 || { cat "$work/build.log"; exit 1; }
ctest --test-dir "$work/plugin" -j2 --no-tests=error --output-on-failure >"$work/tests.log" 2>&1 ||
  { cat "$work/tests.log"; exit 1; }
for kind in $kinds; do expect "${kind}_my_$kind.conformance" "$work/tests.log"; done
for example in "$source"/plugins/template/*/*.yaml; do
  stem=$(basename "$example" .yaml)
  if grep -riE "$stem|${stem//_/}" "$work/new"; then
    say "the name of an example is left"
    exit 1
  fi
done
code=0
"$sidestep" new field my_field --out "$work/new/my_field" 2>"$work/new.txt" || code=$?
[ "$code" -eq 2 ] || { say "exit code $code where the folder exists"; exit 1; }
code=0
"$sidestep" new filed other --out "$work/other" 2>"$work/new.txt" || code=$?
[ "$code" -eq 2 ] || { say "exit code $code for no kind"; exit 1; }
expect "did you mean 'field'?" "$work/new.txt"
code=0
"$sidestep" new field Other-field --out "$work/other" 2>"$work/new.txt" || code=$?
[ "$code" -eq 2 ] || { say "exit code $code for no name"; exit 1; }

# A plugin exports its entry and names of types, nothing of what it was linked from.
if nm -D --defined-only "$work/plugin/my_field/libfield_my_field.so" | grep -vE ' (sidestep_plugin|_ZT[IS].*)$'; then
  say "the plugin exports more than its entry"
  exit 1
fi

path=$(for kind in $kinds; do printf '%s:' "$work/plugin/my_$kind"; done)
env -u LD_LIBRARY_PATH "$sidestep" plugins >"$work/plugins.txt"
expect "voxel_grid" "$work/plugins.txt"
expect "gp_ceres" "$work/plugins.txt"
if grep -q my_field "$work/plugins.txt"; then
  say "a plugin is found without being on the search path"
  exit 1
fi
SIDESTEP_PLUGIN_PATH=$path "$sidestep" plugins my_field >"$work/my_field.txt"
expect "max_distance_m" "$work/my_field.txt"
expect "$work/plugin" "$work/my_field.txt"
# A library is named, too.
SIDESTEP_PLUGIN_PATH=$work/plugin/my_predictor/libpredictor_my_predictor.so "$sidestep" plugins my_predictor >"$work/my_predictor.txt"
expect "widening_mps" "$work/my_predictor.txt"

# The installed command runs an installed configuration by name with the third party's field.
export SIDESTEP_PLUGIN_PATH=$path
"$sidestep" check demo --set field.plugin=my_field
# So does a plan with the third party's cost.
cost='[{cost: {plugin: my_cost, link: hand_palm_link, point_m: [0, 0, 0.2]}}]'
"$sidestep" check demo --set "experiment.plans.0.costs=$cost"
# They run: what they do is seen in the run.
"$sidestep" run demo --out "$work/run" --set field.plugin=my_field \
  --set "experiment.plans.0.costs=$cost" >"$work/run.log" 2>&1 || { cat "$work/run.log"; exit 1; }
grep -q 'plugin: my_field' "$work/run/effective_config.yaml" || { say "ran with another field"; exit 1; }
# A third party's experiment runs, is shown again and compared.
for run in one two; do
  "$sidestep" run "$work/new/my_experiment/my_experiment.yaml" --out "$work/$run" >"$work/$run.log" 2>&1 || { cat "$work/$run.log"; exit 1; }
done
expect "% of the map is known." "$work/one.log"
expect '"known_share"' "$work/one/summary.json"
[ "$(wc -l <"$work/one/table.csv")" -eq 13 ] || { say "table.csv is not a line a frame"; exit 1; }
"$sidestep" report "$work/one" "$work/two" --comparison "$work/comparison.html" >"$work/compared.txt"
expect "Frame by frame" "$work/one/report.html"
[ "$(grep -c my_experiment "$work/compared.txt")" -eq 2 ] || { say "the comparison is not a line a run"; exit 1; }
code=0
"$sidestep" run "$work/new/my_experiment/my_experiment.yaml" --out "$work/three" --set experiment.wanted_share=0.9 >/dev/null 2>&1 || code=$?
[ "$code" -eq 1 ] || { say "exit code $code for a map that is not known enough"; exit 1; }
# Its own check is asked.
code=0
"$sidestep" check demo --set field.plugin=my_field \
  --set field.inflation_m=2 2>"$work/inflated.txt" || code=$?
[ "$code" -eq 2 ] || { say "exit code $code for a mistake in the third party's parameters"; exit 1; }
expect "--set field.inflation_m=2: 'inflation_m' must be below max_distance_m" "$work/inflated.txt"
unset SIDESTEP_PLUGIN_PATH

env -u LD_LIBRARY_PATH "$sidestep" plugins voxel_grid >"$work/voxel_grid.txt"
expect "$prefix/" "$work/voxel_grid.txt"

# The Python module, where it is built, finds what is installed beside it.
module=$(find "$prefix" -name '_core*.so' -path '*dist-packages/sidestep*')
if [ -n "$module" ] || [ -d "$build/python/sidestep" ]; then
  PYTHONPATH=$(dirname "$(dirname "$module")") /usr/bin/python3 - "$prefix" <<'EOF' || { say "the installed Python module does not work"; exit 1; }
import sys
import sidestep
import sidestep.results
session = sidestep.Session()
session.planner(session.robot("hsr"), "gp_chain", sampler="rrt_connect")
maps = open("/proc/self/maps").read()
sys.exit(0 if sys.argv[1] + "/lib" in maps and "build/release/lib" not in maps else 1)
EOF
fi

# Its libraries and plugins are its own, not the build tree's.
if ldd "$sidestep" | grep -F "$build/lib/"; then
  say "the installed command uses the build tree"
  exit 1
fi

# The library in a program of one's own.
mkdir -p "$work/embed"
cp "$source/docs/examples/embed.cpp" "$work/embed/"
cat >"$work/embed/CMakeLists.txt" <<'EOF'
cmake_minimum_required(VERSION 3.22)
project(embed CXX)
find_package(Sidestep REQUIRED)
add_executable(embed embed.cpp)
target_link_libraries(embed PRIVATE Sidestep::runtime)
EOF
cmake -S "$work/embed" -B "$work/embed/build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$cxx" \
  -DCMAKE_BUILD_TYPE=Release >"$work/embed.log" && cmake --build "$work/embed/build" >>"$work/embed.log" 2>&1 ||
  { cat "$work/embed.log"; exit 1; }
"$work/embed/build/embed" >"$work/embed.txt" || { cat "$work/embed.txt"; exit 1; }
expect "valid, " "$work/embed.txt"
[ "$(wc -l <"$source/docs/examples/embed.cpp")" -le 60 ] || { say "embed.cpp has more than 60 lines"; exit 1; }
