two=(--set experiment.seeds=2)
run whole 0 planner_benchmark.yaml "${two[@]}"
for i in 1 2; do run shard-$i 0 planner_benchmark.yaml "${two[@]}" --shard $i/2; done
merge merged 0 shard-2 shard-1
same whole merged
merge twice 2 shard-1 shard-1
run shared 0 planner_benchmark.yaml "${two[@]}" --jobs 2
same whole shared
resume shared 0 planner_benchmark.yaml "${two[@]}" --jobs 2
same whole shared
# Complete: nothing is left to do.
cp -r whole again
resume again 0 planner_benchmark.yaml "${two[@]}"
same whole again
cp -r whole other
resume other 2 planner_benchmark.yaml
# Stopped half way.
many=(--set experiment.seeds=50)
run long 0 planner_benchmark.yaml "${many[@]}"
stop stopped "sampling " planner_benchmark.yaml "${many[@]}"
resume stopped 0 planner_benchmark.yaml "${many[@]}"
same long stopped
run absent 4 planner_benchmark.yaml --set experiment.problems=absent.json
run refused 2 planner_benchmark.yaml --set experiment.planners.0.name=sampling --set experiment.deadline_s=0
run too-many 2 planner_benchmark.yaml --shard 1/3
compare compared 0 whole shard-1
redraw whole
redraw merged
keeps whole shard-1 compared
keeps_ends merged twice other absent refused too-many
