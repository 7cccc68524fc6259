run whole 0 plan.yaml
run other 0 plan.yaml --set optimiser.plugin=gp_ceres --set planning.retime=false
# One plan is stuck in the pillar, the other one's goal is within it.
run failed 1 plan.yaml --set planning.attempts=1 --set experiment.plans.1.goal.joints.x=1.5 \
  --set experiment.plans.1.goal.joints.y=0
run empty 1 plan.yaml --set 'mapper.origin_m=[40, 40, 0]'
run json 0 plan.yaml --json
cmp json.stdout json/summary.json || complain "--json prints another summary than it writes"
run refused 2 plan.yaml --set experiment.plan=1 --set planning.dt_s=0
run divided 2 plan.yaml --shard 1/2
cp -r whole resumed
resume resumed 2 plan.yaml
compare compared 0 whole other
redraw whole
redraw failed
keeps whole other failed empty compared
keeps_ends refused divided resumed
