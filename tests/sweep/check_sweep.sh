#!/usr/bin/env bash
# A sweep of 3 x 3 x 3 runs that is interrupted, and goes on; of which one is killed then: it is told, no other is lost,
# and the same command makes it up.
#
#   check_sweep.sh SIDESTEP WORK here | slurm PLUGINS      77: Slurm is not installed
set -euo pipefail
sidestep=$1 work=$2 where=$3 plugins=$4
sweep=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/sweep.yaml
failed=0
rm -rf "$work"
mkdir -p "$work"
how=(--jobs 2)
if [ "$where" = slurm ]; then
  command -v sbatch slurmctld slurmd >/dev/null || exit 77
  . "$(dirname "$sweep")/slurm_cluster.sh"
  begin_cluster "$work/cluster" 27017
  how=(--slurm --slurm-option=--cpus-per-task=1)
fi

# told CODE TEXT...: the exit code of the last sweep, and what its log says.
told() {
  [ "$code" -eq "$1" ] || { echo "exit code $code, expected $1"; failed=1; }
  for text in "${@:2}"; do grep -qF -- "$text" "$work/log" || { echo "'$text' is not told"; failed=1; }; done
  [ "$failed" -eq 0 ] || { cat "$work/log"; exit 1; }
}

out=$work/out
begin() {
  code=0
  "$sidestep" sweep "$sweep" --out "$out" "${how[@]}" >"$work/log" 2>&1 &
  sweeping=$!
}
# until COMMAND...: waits two minutes until it succeeds.
until_() {
  for _ in $(seq 2400); do
    ! "$@" || return 0
    sleep 0.05
  done
  echo "never: $*"
  exit 1
}
done_() { ls "$out"/*/report.html 2>/dev/null | wc -l; }
is_under_way() { [ "$(done_)" -ge 3 ]; }

begin
until_ is_under_way
kill -INT "$sweeping"
wait "$sweeping" || code=$?
told 1 "Not done: "
interrupted=$((27 - $(sed -n 's/.*Not done: \([0-9]*\);.*/\1/p' "$work/log")))
reports=$(done_)  # of runs that were interrupted, too
[ "$interrupted" -lt 20 ] || { echo "$interrupted runs were done after an interrupt"; exit 1; }
is_idle() { [ -z "$(squeue --noheader)" ]; }
[ "$where" = here ] || until_ is_idle  # tasks that are cancelled take a moment to end
sleep 1
[ -z "$(pgrep -f "sidestep run .*--out $out/" || true)" ] || { echo "runs go on after an interrupt"; exit 1; }
[ "$(done_)" -eq "$reports" ] || { echo "runs go on after an interrupt"; exit 1; }

touch "$work/begun"
begin
# The process that does run 14, and the one in it.
runs_14() { victims=$(pgrep -f "sidestep run .*--out $out/14-"); }
until_ runs_14
kill -KILL $victims
wait "$sweeping" || code=$?
told 4 "Of 27 runs 26 succeeded and 0 failed. Not done: 1; the same command goes on with them:" "  14-"
[ "$where" = slurm ] || told 4 "killed by SIGKILL"
[ "$where" != slurm ] || told 4 "its task ended before it was done, see task-14.log"
[ "$(done_)" -eq 26 ] || { echo "not 26 runs are left"; exit 1; }
again() { find "$out" -mindepth 2 -name summary.json -newer "$work/begun" | wc -l; }
[ "$(again)" -eq $((26 - interrupted)) ] || { echo "what was done before the interrupt is done again"; exit 1; }

touch "$work/begun"
code=0
"$sidestep" sweep "$sweep" --out "$out" "${how[@]}" >"$work/log" 2>&1 || code=$?
told 0 "Of 27 runs 27 succeeded and 0 failed." "report: $out/sweep.html"
[ "$(again)" -eq 1 ] || { echo "what was done is done again"; exit 1; }

# Each run had its values, and the table has them.
grep -q 'interpolated_checks: 2 ' "$out"/*planning.interpolated_checks=2-experiment.seed=3/effective_config.yaml
[ "$(wc -l <"$out/sweep.csv")" -eq 28 ] || { echo "sweep.csv is not a line a run"; exit 1; }
head -1 "$out/sweep.csv" | grep -q '^run,optimiser.plugin,planning.interpolated_checks,experiment.seed,optimiser,' ||
  { head -2 "$out/sweep.csv"; exit 1; }
for n in $(seq -w 27); do grep -q "^$n," "$out/sweep.csv" || { echo "run $n is not in sweep.csv"; exit 1; }; done
grep -q '<img' "$out/sweep.html" || { echo "the page has no plot"; exit 1; }
[ "$where" = here ] || exit 0

# A run that a fault ends is not done, whatever it has left.
cat >"$work/faulty.yaml" <<EOF
schema_version: 1
configuration: $(dirname "$sweep")/plan.yaml
runs:
  - {experiment.seed: 7}
  - {mapper: {plugin: throwing, resolution_m: 0.1, size_vox: [54, 54, 22]}}
EOF
for _ in first again; do
  code=0
  SIDESTEP_PLUGIN_PATH=$plugins "$sidestep" sweep "$work/faulty.yaml" --out "$work/faulty" >"$work/log" 2>&1 || code=$?
  told 4 "Of 2 runs 1 succeeded and 0 failed. Not done: 1" ": exit code 4"
done
# So is one whose report was cut off, as where a disk is full; a task does it, and does nothing twice.
head -c 1000 "$work/faulty/1-experiment.seed=7/report.html" >"$work/part"
cp "$work/part" "$work/faulty/1-experiment.seed=7/report.html"
for text in "Success: plan 'away'" "1-experiment.seed=7 is done"; do
  code=0
  SIDESTEP_PLUGIN_PATH=$plugins "$sidestep" sweep "$work/faulty.yaml" --out "$work/faulty" --task 1 >"$work/log" 2>&1 || code=$?
  told 0 "$text"
done
code=0
SIDESTEP_PLUGIN_PATH=$plugins "$sidestep" sweep "$work/faulty.yaml" --out "$work/faulty" --task 3 >"$work/log" 2>&1 || code=$?
told 2 "--task 3: there are 2 runs"

# Mistakes are told before anything runs.
# mistake TEXT < SWEEP
mistake() {
  code=0
  cat >"$work/wrong.yaml"
  "$sidestep" sweep "$work/wrong.yaml" --out "$work/wrong" >"$work/log" 2>&1 || code=$?
  told 2 "$1"
  [ ! -e "$work/wrong" ] || { echo "a folder is left for '$1'"; exit 1; }
}
plan=$(dirname "$sweep")/plan.yaml
mistake "wrong.yaml:3:1: unknown key 'gird' (did you mean 'grid'?)" <<EOF
schema_version: 1
configuration: $plan
gird: {experiment.seed: [1]}
EOF
mistake "'experiment.seed' must be a list of values" <<EOF
{schema_version: 1, configuration: $plan, grid: {experiment.seed: 1}}
EOF
mistake "'experiment.seed' has the value 1 twice" <<EOF
{schema_version: 1, configuration: $plan, grid: {experiment.seed: [1, 1]}}
EOF
mistake "'experiment.seed' is in the grid, too" <<EOF
{schema_version: 1, configuration: $plan, grid: {experiment.seed: [1]}, runs: [{experiment.seed: 2}]}
EOF
mistake "'optimiser.plugin' is in the grid, too, as 'optimiser'" <<EOF
{schema_version: 1, configuration: $plan, grid: {optimiser: [{plugin: gp_chain}]}, runs: [{optimiser.plugin: chomp}]}
EOF
mistake "the same run is there before" <<EOF
{schema_version: 1, configuration: $plan, runs: [{experiment.seed: 2}, {experiment.seed: 2}]}
EOF
mistake "there is nothing to vary" <<EOF
{schema_version: 1, configuration: $plan}
EOF
mistake "there is no such configuration" <<EOF
{schema_version: 1, configuration: no_such, grid: {experiment.seed: [1]}}
EOF
mistake "run 2-mapper.resolution_m=-1: " <<EOF
{schema_version: 1, configuration: $plan, grid: {mapper.resolution_m: [0.1, -1]}}
EOF
code=0
sed 's/seed: \[1, 2, 3\]/seed: [1, 2]/' "$sweep" >"$work/other.yaml"
cp "$plan" "$work/"
"$sidestep" sweep "$work/other.yaml" --out "$out" >"$work/log" 2>&1 || code=$?
told 2 "the folder holds another sweep, or one of another configuration"
