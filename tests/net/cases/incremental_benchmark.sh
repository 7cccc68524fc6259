run whole 0 incremental_benchmark.yaml
for i in 1 2; do run shard-$i 0 incremental_benchmark.yaml --shard $i/2; done
merge merged 0 shard-2 shard-1
same whole merged
merge twice 2 shard-1 shard-1
run shared 0 incremental_benchmark.yaml --jobs 2
same whole shared
# Complete: nothing is left to do.
cp -r whole again
resume again 0 incremental_benchmark.yaml
same whole again
cp -r whole changed
resume changed 2 incremental_benchmark.yaml --set experiment.goal_sd=0.2
# Stopped half way.
many=(--set experiment.repeats=1000)
run long 0 incremental_benchmark.yaml "${many[@]}"
stop stopped "study, signed, other goal" incremental_benchmark.yaml "${many[@]}"
resume stopped 0 incremental_benchmark.yaml "${many[@]}"
same long stopped
sed 's/\[1\.0, 1\.0\]\]/[1e300, 1e300]]/' recorded_problems.json >overflow.json
run failed 1 incremental_benchmark.yaml --set experiment.problems=overflow.json --set 'experiment.runs=[study]'
run refused 2 incremental_benchmark.yaml --set 'experiment.runs=[studi]' --set optimiser.incremental=true
run too-many 2 incremental_benchmark.yaml --shard 1/7
compare compared 0 whole failed
redraw whole
redraw merged
keeps whole shard-1 failed compared
keeps_ends merged twice changed refused too-many
