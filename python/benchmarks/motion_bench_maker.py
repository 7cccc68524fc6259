"""What planning from Python costs beyond the command, on MotionBenchMaker's problems for the Panda.

usage: motion_bench_maker.py PROBLEMS [ROUNDS]    a problem set: a folder, or a family's file

By turns, the command and Python solve every problem with the planners `hybrid` and `rrt_connect` of
configs/peers/mbm_panda.yaml and hold each answer against the robot's own shapes. Prints how long either takes for
the set, in each round, and the time of calls that do next to nothing. `sidestep` has to be in the PATH.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
import timeit

import numpy as np
import sidestep
from sidestep.results import Run

CONFIGURATION = pathlib.Path(__file__).resolve().parents[2] / "configs/peers/mbm_panda.yaml"
PLANNERS = ("hybrid", "rrt_connect")


def by_command(experiment):
    """Seconds for the set, without start and report."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "benchmark.yaml"
        file.write_text(json.dumps({"base": str(CONFIGURATION), "experiment": experiment}))
        subprocess.run(["sidestep", "run", file, "--out", f"{folder}/run"], check=True,
                       capture_output=True)
        return Run(f"{folder}/run").table("session")["wall_s"].sum()


def by_python(session, configuration, planners, problems, robot):
    begun = time.perf_counter()
    for entry in planners:
        planner = session.planner(robot, entry.get("optimiser"), entry.get("sampler"), entry["seeds"],
                                  configuration["planning"], configuration["check"])
        for problem in [problems[0], *problems]:  # the first does not count, as the command's
            plan = planner.plan(problem.scene.field([-2.0] * 3, [2.0] * 3), problem.start,
                                problem.goal, 5.0, 7)
            if plan:
                check = sidestep.shape_check(robot, problem.scene, check=configuration["check"])
                for trajectory in [*plan.earlier, plan.trajectory]:
                    check.check(trajectory)
    return time.perf_counter() - begun


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    rounds = int(sys.argv[2]) if len(sys.argv) == 3 else 5
    session = sidestep.Session(seed=7)
    configuration = session.configuration(CONFIGURATION)
    robot = session.robot(configuration["robot"])
    problems = sidestep.read_problem_set(sys.argv[1], robot)
    planners = [planner for planner in configuration["experiment"]["planners"]
                if planner["name"] in PLANNERS]
    experiment = {"problems": str(pathlib.Path(sys.argv[1]).resolve()), "planners": planners}
    ratios = []
    for _ in range(rounds):
        told_s = by_command(experiment)
        ours_s = by_python(session, configuration, planners, problems, robot)
        ratios.append(ours_s / told_s)
        print(f"command {told_s:.2f} s, Python {ours_s:.2f} s, {100 * (ratios[-1] - 1):+.1f} %",
              flush=True)
    print(f"{100 * (statistics.median(ratios) - 1):+.1f} % (median of {rounds})")

    field = problems[0].scene.field([-2.0] * 3, [2.0] * 3)
    point_m, q = np.zeros((1, 3)), problems[0].start
    for name, call in (("robot.dof", lambda: robot.dof),
                       ("field.distance, one point", lambda: field.distance(point_m)),
                       ("robot.link_poses", lambda: robot.link_poses(q))):
        best_s = min(timeit.repeat(call, number=10000, repeat=5)) / 10000
        print(f"{name}: {1e6 * best_s:.2f} us a call")


if __name__ == "__main__":
    main()
