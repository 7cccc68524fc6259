#!/usr/bin/env bash
# Kills a run that is being recorded, without warning, and has `rosbag reindex` recover the bag. Exit
# code 77 where there is no rosbag.
#
#   check_killed.sh SIDESTEP CONFIG FOLDER
set -euo pipefail
sidestep=$1 config=$2 folder=$3
/usr/bin/python3 -c 'import rosbag' 2>/dev/null || {
  echo "skipped: no rosbag (tools/install_deps.sh --dev)"
  exit 77
}
rm -rf "$folder"
mkdir -p "$folder"
bag=$folder/killed.bag
"$sidestep" run "$config" --set experiment.clock=wall --set experiment.duration_s=100 \
  --set experiment.goal.joints.x=1.3 --set experiment.goal.joints.y=-0.1 --set experiment.random=null \
  --out "$folder/run" --record "$bag" >"$folder/log" 2>&1 &
process=$!
# Until something of every topic has come to the disk, and 100 kB after it; the run lasts far longer.
topics="/joint_states /camera/depth/image_rect /tf /sidestep/events"
size() { stat -c %s "$bag" 2>/dev/null || echo 0; }
all_there() { for topic in $topics; do grep -aqs "topic=$topic" "$bag" || return 1; done; }
wait_until() {
  until "$@"; do
    kill -0 "$process" || { echo "the run has ended:"; tail "$folder/log"; exit 1; }
    sleep 0.05
  done
}
wait_until all_there
enough=$(($(size) + 100000))
grown() { [ "$(size)" -ge "$enough" ]; }
wait_until grown
kill -KILL "$process"
{ wait "$process" || true; } 2>/dev/null

info() { rosbag info --yaml "$bag" 2>/dev/null || true; }
indexed() { grep -q '^indexed: True' <<<"$(info)"; }
! indexed || { echo "a bag that was not closed has an index"; exit 1; }
rosbag reindex "$bag" >"$folder/reindex.log" 2>&1
indexed || { echo "rosbag could not recover the bag:"; cat "$folder/reindex.log"; exit 1; }
found=$(info)
for topic in $topics; do
  grep -q "topic: $topic\$" <<<"$found" || { echo "$topic is lost"; exit 1; }
done
grep '^messages:' <<<"$found"
