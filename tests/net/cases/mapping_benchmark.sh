run whole 0 mapping_benchmark.yaml
for i in 1 2 3; do run shard-$i 0 mapping_benchmark.yaml --shard $i/3; done
merge merged 0 shard-3 shard-1 shard-2
same whole merged
merge incomplete 1 shard-3 shard-1
merge twice 2 shard-1 shard-1
run shared 0 mapping_benchmark.yaml --jobs 2
same whole shared
# Complete: nothing is left to do.
cp -r whole again
resume again 0 mapping_benchmark.yaml
same whole again
cp -r whole changed
resume changed 2 mapping_benchmark.yaml --set experiment.accuracy_every=4
# Stopped half way.
many=(--set source.frames=200)
run long 0 mapping_benchmark.yaml "${many[@]}"
stop stopped "exact at 0.2 m" mapping_benchmark.yaml "${many[@]}"
resume stopped 0 mapping_benchmark.yaml "${many[@]}"
same long stopped
few=(--set experiment.clock=every_frame --set 'experiment.resolutions_m=[0.2]')
run unmet 1 mapping_benchmark.yaml "${few[@]}" --set 'experiment.expect={collision_recall: 1.0, appear_frames: 0}'
run empty 1 mapping_benchmark.yaml "${few[@]}" --set 'experiment.origin_m=[40, 40, 0]'
run refused 2 mapping_benchmark.yaml --set experiment.reference=exactly --set experiment.clok=both
run too-many 2 mapping_benchmark.yaml --shard 1/7
compare compared 0 whole unmet
redraw whole
redraw merged
keeps whole shard-1 unmet empty compared
keeps_ends merged incomplete twice changed refused too-many
