run whole 0 recorded_benchmark.yaml
run other 0 recorded_benchmark.yaml --set optimiser.plugin=gp_ceres --set 'experiment.runs=[study]' \
  --set experiment.every=2
# No cost is finite where a configuration is that far away.
sed 's/\[1\.0, 1\.0\]\]/[1e300, 1e300]]/' recorded_problems.json >overflow.json
run failed 1 recorded_benchmark.yaml --set experiment.problems=overflow.json
run refused 2 recorded_benchmark.yaml --set 'experiment.runs=[studi]' --set optimiser.max_iterations=7
run absent 2 recorded_benchmark.yaml --set experiment.problems=absent.json
run divided 2 recorded_benchmark.yaml --shard 1/2
cp -r whole resumed
resume resumed 2 recorded_benchmark.yaml
compare compared 0 whole other
redraw whole
keeps whole other failed compared
keeps_ends refused absent divided resumed
