run whole 0 recorded_benchmark.yaml
for i in 1 2 3; do run shard-$i 0 recorded_benchmark.yaml --shard $i/3; done
merge merged 0 shard-3 shard-1 shard-2
same whole merged
merge incomplete 1 shard-3 shard-1
merge twice 2 shard-1 shard-1
run shared 0 recorded_benchmark.yaml --jobs 2
same whole shared
# Complete: nothing is left to do.
cp -r whole again
resume again 0 recorded_benchmark.yaml
same whole again
cp -r whole changed
resume changed 2 recorded_benchmark.yaml --set experiment.seed=8
# Stopped half way.
many=(--set experiment.repeats=1000)
run long 0 recorded_benchmark.yaml "${many[@]}"
stop stopped "study, signed" recorded_benchmark.yaml "${many[@]}"
resume stopped 0 recorded_benchmark.yaml "${many[@]}"
same long stopped
run other 0 recorded_benchmark.yaml --set optimiser.plugin=gp_ceres --set 'experiment.runs=[study]' \
  --set experiment.every=2
# No cost is finite where a configuration is that far away.
sed 's/\[1\.0, 1\.0\]\]/[1e300, 1e300]]/' recorded_problems.json >overflow.json
run failed 1 recorded_benchmark.yaml --set experiment.problems=overflow.json
run refused 2 recorded_benchmark.yaml --set 'experiment.runs=[studi]' --set optimiser.max_iterations=7
run absent 2 recorded_benchmark.yaml --set experiment.problems=absent.json
run too-many 2 recorded_benchmark.yaml --shard 1/7
compare compared 0 whole other
redraw whole
redraw merged
keeps whole shard-1 incomplete other failed compared
keeps_ends merged twice changed refused absent too-many
