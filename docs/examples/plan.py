"""From recorded depth images to a motion that is proven clear of what they show.

usage: plan.py FOLDER [MOTION.csv]    a sequence in the layout of 7-Scenes, TUM RGB-D or Open3D
"""
import sys

import sidestep

session = sidestep.Session()
hsr = session.robot("hsr")
world = session.map({"plugin": "voxel_grid", "resolution_m": 0.05, "size_vox": [160, 160, 48],
                     "origin_m": [-2.0, -4.0, -0.1]}, {"plugin": "edt", "unknown": "free"})
for frame in session.source({"plugin": "depth_sequence", "path": sys.argv[1]}):
    field = world.integrate(frame)
planner = session.planner(hsr, "gp_chain", sampler="rrt_connect", planning={"unknown": "free"})
here = {"odom_x": 0.0, "odom_y": 0.0, "odom_t": 0.0}
plan = planner.plan(field, start={"pose": "go", "joints": here},
                    goal={"pose": "go", "joints": {**here, "odom_x": 3.0}})
if not plan:
    sys.exit(plan.reason)
print(f"{plan.trajectory.duration_s:.1f} s long, found in {plan.took_ms:.0f} ms,",
      sidestep.certify(hsr, field, plan.trajectory, unknown="free").outcome)
if len(sys.argv) > 2:
    plan.trajectory.write(sys.argv[2], hsr)
