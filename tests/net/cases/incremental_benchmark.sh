run whole 0 incremental_benchmark.yaml
sed 's/\[1\.0, 1\.0\]\]/[1e300, 1e300]]/' recorded_problems.json >overflow.json
run failed 1 incremental_benchmark.yaml --set experiment.problems=overflow.json --set 'experiment.runs=[study]'
run refused 2 incremental_benchmark.yaml --set 'experiment.runs=[studi]' --set optimiser.incremental=true
run divided 2 incremental_benchmark.yaml --shard 1/2
cp -r whole resumed
resume resumed 2 incremental_benchmark.yaml
compare compared 0 whole failed
redraw whole
keeps whole failed compared
keeps_ends refused divided resumed
