run whole 0 field_study.yaml
for i in 1 2 3; do run shard-$i 0 field_study.yaml --shard $i/3; done
merge merged 0 shard-3 shard-1 shard-2
same whole merged
merge incomplete 1 shard-1 shard-2
merge twice 2 shard-1 shard-1
run shared 0 field_study.yaml --jobs 2
same whole shared
resume shared 0 field_study.yaml --jobs 2
same whole shared
# Complete: nothing is left to do.
cp -r whole again
resume again 0 field_study.yaml
same whole again
cp -r whole other
resume other 2 field_study.yaml --set planning.epsilon_m=0.25
cp -r whole part
resume part 2 field_study.yaml --shard 1/2
# Stopped half way.
many=(--set experiment.scenes=200)
run long 0 field_study.yaml "${many[@]}"
stop stopped "large " field_study.yaml "${many[@]}"
resume stopped 0 field_study.yaml "${many[@]}"
same long stopped
run refused 2 field_study.yaml --set field.signed=true --set experiment.robots.1.name=small
run too-many 2 field_study.yaml --shard 1/11
compare compared 0 whole incomplete
redraw whole
redraw merged
keeps whole shard-1 incomplete compared
keeps_ends merged twice other part refused too-many
