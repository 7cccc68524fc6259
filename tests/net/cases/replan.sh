run whole 0 replan.yaml
run begun 0 replan.yaml --set experiment.episodes=1
resume begun 0 replan.yaml
same whole begun
cp -r whole other
resume other 2 replan.yaml --set planning.qc=2.0
run blocked 1 replan.yaml --set experiment.goal.joints.x=1.3 --set experiment.goal.joints.y=-0.3 \
  --set experiment.random=null --set experiment.episodes=1 --set experiment.duration_s=6
# Nothing brakes for what moves.
run touched 1 replan.yaml --set replanner.obstacle_speed_mps=0 --set experiment.episodes=1
run refused 2 replan.yaml --set planning.attempts=3 --set experiment.goal.joints.z=1
for i in 1 2; do run shard-$i 0 replan.yaml --shard $i/2; done
merge merged 0 shard-2 shard-1
same whole merged
run divided 2 replan.yaml --shard 1/3
compare compared 0 whole blocked
redraw whole
redraw touched
keeps whole blocked touched compared
keeps_ends other refused divided
