#!/usr/bin/env bash
# Libraries that end the process that opens them, or never come back: each is refused, with the reason, and the
# command goes on without it, alone and with all others in one search path.
#
#   check_harm.sh SIDESTEP LIBRARIES CONFIGURATION WORK
set -euo pipefail
sidestep=$1 libraries=$2 configuration=$3 work=$4
mkdir -p "$work"
failed=0

# refused FOLDER TEXT: what `plugins` says of the library, and that an unrelated configuration is still right.
refused() {
  local code=0
  SIDESTEP_PLUGIN_PATH=$libraries/$1 "$sidestep" plugins edt >"$work/out" 2>"$work/err" || code=$?
  if [ "$code" -ne 0 ] || ! grep -qF "$libraries/$1/plugin.so: $2" "$work/err" || ! grep -q max_distance_m "$work/out"; then
    echo "$1: exit code $code, expected 0 and '$2' in:"
    cat "$work/err"
    failed=1
  fi
  [ "$1" != construct_harm_hang ] || return 0  # 20 s
  if ! SIDESTEP_PLUGIN_PATH=$libraries/$1 "$sidestep" check "$configuration" >"$work/out" 2>"$work/err"; then
    echo "$1: check fails"
    cat "$work/err"
    failed=1
  fi
}

crashed="crashed (Segmentation fault) as it was opened"
gave_up="aborted (abort() or an uncaught exception) as it was opened"
exited="ended the process with exit code"
refused construct_harm_segv "$crashed"
refused construct_harm_abort "$gave_up"
refused construct_harm_exit "$exited 0 as it was opened"
refused construct_harm_quick_exit "$exited 0 as it was opened"
refused construct_harm_throw "$gave_up"
refused construct_harm_kill "killed by SIGKILL (out of memory?) as it was opened"
refused construct_harm_hang "takes more than 20 s to be opened"
refused construct_harm_close "closes standard input, output or error as it was opened"
# What can be put back is.
for harm in alarm fork limit mask; do
  code=0
  SIDESTEP_PLUGIN_PATH=$libraries/construct_harm_$harm "$sidestep" check "$configuration" >"$work/out" 2>"$work/err" || code=$?
  if [ "$code" -ne 0 ] || [ "$(grep -c . "$work/out")" -ne 1 ]; then
    echo "$harm: exit code $code"
    cat "$work/out" "$work/err"
    failed=1
  fi
done
# Signals come later than what sends them, and a thread of a library's ends the process later.
for end in "signal sends signals to other processes" "late_abort aborted (abort() or an uncaught exception)" "late_exit "; do
  command=(run "$configuration" --out "$work/late")
  [ "${end%% *}" != signal ] || command=(plugins edt)  # which tells what is refused
  code=0
  SIDESTEP_PLUGIN_PATH=$libraries/construct_harm_${end%% *} "$sidestep" "${command[@]}" >"$work/out" 2>"$work/err" || code=$?
  if ! grep -qF "construct_harm_${end%% *}/plugin.so" "$work/err" || ! grep -qF "${end#* }" "$work/err"; then
    echo "late ${end%% *}: exit code $code"
    cat "$work/err"
    failed=1
  fi
done
for stage in descriptor schema; do
  refused "${stage}_harm_segv" "$crashed"
  refused "${stage}_harm_abort" "$gave_up"
  refused "${stage}_harm_exit" "$exited 0 as it was opened"
  refused "${stage}_harm_quick_exit" "$exited 0 as it was opened"
  refused "${stage}_harm_kill" "killed by SIGKILL (out of memory?) as it was opened"
done
refused address_sanitizer "$exited 1 as it was opened"
refused thread_sanitizer "cannot be loaded: "

# Files that are cut off, and files some bytes of which are not what they were: whatever they do to the loader.
rm -rf "$work/forged"
forge() { mkdir -p "$work/forged/$1" && cat >"$work/forged/$1/plugin.so"; }
good=$libraries/create_silent/plugin.so
for size in 1 16 63 64 65 200 500 1000 2000 4095 4096 4097 8192 12288 16384 20480 30000; do
  head -c "$size" "$good" | forge "cut_$size"
done
for at in 4 5 16 18 20 24 32 40 48 54 56 58 60 64 72 80 96 104 120 200 300 400 500 700 900; do
  { head -c "$at" "$good"; printf '\377\177\377'; tail -c +$((at + 4)) "$good"; } | forge "changed_at_$at"
done
# What is cut off is refused; what is changed is refused, or a plugin still: in bytes that nobody reads.
for folder in "$work"/forged/*; do
  code=0
  SIDESTEP_PLUGIN_PATH=$folder "$sidestep" plugins >"$work/out" 2>"$work/err" || code=$?
  refusals=$(grep -cF "$folder/plugin.so is not usable: " "$work/err") || true
  listings=$(grep -c ' broken ' "$work/out") || true
  if [ "$code" -ne 0 ] || ! grep -q ' edt ' "$work/out" || [ $((refusals + listings)) -ne 1 ] ||
    { [[ $folder == */cut_* ]] && [ "$refusals" -ne 1 ]; }; then
    echo "$folder: exit code $code, refused $refusals, listed $listings"
    cat "$work/err"
    failed=1
  fi
done

# validated FOLDER CODE TEXT: what a validation of the library ends with.
validated() {
  local code=0
  "$sidestep" validate "$libraries/$1/plugin.so" >"$work/out" 2>"$work/err" || code=$?
  if [ "$code" -ne "$2" ] || ! grep -qF "$3" "$work/err"; then
    echo "validation of $1: exit code $code, expected $2 and '$3' in:"
    cat "$work/out" "$work/err"
    failed=1
  fi
}
validated construct_harm_segv 3 "$crashed"
validated schema_harm_exit 3 "$exited 0 as it was opened"
validated not_elf 3 "cannot be loaded"
validated march 3 "EIGEN_MAX_ALIGN_BYTES"

# All of them at once, the hanging one aside, which takes 20 s.
SIDESTEP_PLUGIN_PATH=$(find "$libraries" -mindepth 1 -maxdepth 1 -type d ! -name '*hang' -printf '%p:')
export SIDESTEP_PLUGIN_PATH
if ! "$sidestep" check "$configuration" >"$work/out" 2>"$work/err"; then
  echo "with all of them check fails:"
  cat "$work/err"
  failed=1
fi

# used STAGE HARM CODE TEXT: a run whose mapper does harm there.
used() {
  local code=0
  SIDESTEP_PLUGIN_PATH=$libraries/$1_harm_$2 "$sidestep" run "$configuration" --set mapper.plugin=broken \
    --set mapper.size_m=1 --out "$work/run" >"$work/out" 2>"$work/err" || code=$?
  if [ "$code" -ne "$3" ] || ! grep -qF "$4" "$work/err"; then
    echo "$1 $2: exit code $code, expected $3 and '$4' in:"
    cat "$work/err"
    failed=1
  fi
}
for stage in check create; do
  used $stage segv 3 "plugin mapper broken: crashed (Segmentation fault)"
  used $stage abort 3 "plugin mapper broken: aborted"
  used $stage exit 3 "plugin mapper broken: $exited 0"
  used $stage quick_exit 3 "plugin mapper broken: $exited 0"
  used $stage kill 3 "plugin mapper broken: killed by SIGKILL"
done
# What libraries do after the command has ended does not count, and nothing of its output is lost.
unset SIDESTEP_PLUGIN_PATH
"$sidestep" plugins 2>/dev/null >"$work/expected"
for harm in segv abort exit quick_exit kill; do
  code=0
  SIDESTEP_PLUGIN_PATH=$libraries/destruct_harm_$harm "$sidestep" plugins 2>"$work/err" >"$work/out" || code=$?
  if [ "$code" -ne 0 ] || ! diff <(grep -v ' broken ' "$work/out") "$work/expected"; then
    echo "destruct $harm: exit code $code"
    cat "$work/err"
    failed=1
  fi
done
# Whoever ignores the ends of children is told of this one's.
(trap '' CHLD && exec timeout 60 "$sidestep" --version) >/dev/null || { echo "SIGCHLD ignored: exit code $?"; failed=1; }
exit $failed
