# Two goals are given up.
run whole 1 deploy.yaml
run one 0 deploy.yaml --set experiment.goals=1
run refused 2 deploy.yaml --set 'executor.goals=[{goal: {joints: {x: 1.0}}}]' --set experiment.pictures=-1
run divided 2 deploy.yaml --shard 1/2
cp -r whole resumed
resume resumed 2 deploy.yaml
redraw whole
keeps whole one
keeps_ends refused divided resumed
