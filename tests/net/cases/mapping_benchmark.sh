run whole 0 mapping_benchmark.yaml
few=(--set experiment.clock=every_frame --set 'experiment.resolutions_m=[0.2]')
run unmet 1 mapping_benchmark.yaml "${few[@]}" --set 'experiment.expect={collision_recall: 1.0, appear_frames: 0}'
run empty 1 mapping_benchmark.yaml "${few[@]}" --set 'experiment.origin_m=[40, 40, 0]'
run refused 2 mapping_benchmark.yaml --set experiment.reference=exactly --set experiment.clok=both
run divided 2 mapping_benchmark.yaml --shard 1/2
cp -r whole resumed
resume resumed 2 mapping_benchmark.yaml
compare compared 0 whole unmet
redraw whole
keeps whole unmet empty compared
keeps_ends refused divided resumed
