"""Robots, trajectories, planners, checks, proofs, and parts of a planner that are written here."""

import csv
import json
import math
import pathlib
import sys
import tempfile
import threading
import time
import unittest

import numpy as np
import sidestep

SESSION = sidestep.Session()
PANDA = SESSION.robot("panda")
FREE = {"unknown": "free", "outside": "free"}
BOX = {"objects": [{"name": "box", "shape": {"box": {"size_m": [0.2, 0.2, 0.6]}},
                    "pose": {"xyz_m": [0.5, 0.0, 0.3]}}]}
# The arm reaches to the right and to the left of the box.
RIGHT = np.array([-0.8, 0.4, 0.0, -1.9, 0.0, 2.3, 0.785])
LEFT = RIGHT * [-1, 1, 1, 1, 1, 1, 1]


def field_of(scene):
    return scene.field([-2.0] * 3, [2.0] * 3)


class Robots(unittest.TestCase):
    def test_tell_joints_and_poses(self):
        self.assertEqual((PANDA.name, PANDA.dof, len(PANDA.joints)), ("panda", 7, 7))
        joint = PANDA.joints[0]
        self.assertEqual((joint.name, joint.unit), ("panda_joint1", "rad"))
        self.assertLess(joint.lower, joint.upper)
        hsr = SESSION.robot("hsr")
        self.assertIn("go", hsr.poses)
        here = dict.fromkeys(["odom_x", "odom_y", "odom_t"], 0.25)
        q = hsr.configuration({"pose": "go", "joints": here})
        for name, value in {**hsr.pose("go"), **here}.items():
            self.assertEqual(q[[joint.name for joint in hsr.joints].index(name)], value)

    def test_move_as_their_kinematics_say(self):
        # Joint 1 of the Panda turns all that is above it about the world's z.
        q = RIGHT.copy()
        turned = RIGHT + [0.5, 0, 0, 0, 0, 0, 0]
        about_z = np.array([[math.cos(0.5), -math.sin(0.5), 0],
                            [math.sin(0.5), math.cos(0.5), 0], [0, 0, 1]])
        hand = PANDA.links.index("panda_hand")
        np.testing.assert_allclose(about_z @ PANDA.link_poses(q)[hand, :3, :3],
                                   PANDA.link_poses(turned)[hand, :3, :3], atol=1e-12)
        centres_m = PANDA.sphere_centres([q, turned])
        self.assertEqual(centres_m.shape, (2, len(PANDA.sphere_radii_m), 3))
        np.testing.assert_allclose(np.hypot(*centres_m[0, :, :2].T),
                                   np.hypot(*centres_m[1, :, :2].T), atol=1e-12)
        np.testing.assert_array_equal(PANDA.sphere_centres(q)[0], centres_m[0])

    def test_name_what_is_wrong(self):
        with self.assertRaisesRegex(ValueError, "7 values"):
            PANDA.link_poses(np.zeros(6))
        with self.assertRaisesRegex(sidestep.Error, "no pose 'reday'"):
            PANDA.pose("reday")
        with self.assertRaisesRegex(TypeError, "numbers"):
            PANDA.configuration(["left"] * 7)
        with self.assertRaisesRegex(sidestep.Error, "pandaa"):
            SESSION.robot("pandaa")


class Trajectories(unittest.TestCase):
    def setUp(self):
        self.given = sidestep.Trajectory([0.0, 1.0], [RIGHT, LEFT], np.zeros((2, 7)))

    def test_are_cubics(self):
        q, qdot = self.given.sample(0.25)
        share = 3 * 0.25**2 - 2 * 0.25**3
        np.testing.assert_allclose(q, RIGHT + share * (LEFT - RIGHT), atol=1e-12)
        np.testing.assert_allclose(qdot, 6 * (0.25 - 0.25**2) * (LEFT - RIGHT), atol=1e-12)
        self.assertEqual(self.given.sample([0.1, 0.2, 5.0])[0].shape, (3, 7))
        np.testing.assert_array_equal(self.given.sample(5.0)[0], LEFT)

    def test_are_views_that_cannot_be_written(self):
        positions = self.given.positions
        self.assertTrue(np.shares_memory(positions, self.given.positions))
        with self.assertRaises(ValueError):
            positions[0, 0] = 1.0
        self.given = None
        np.testing.assert_array_equal(positions, [RIGHT, LEFT])

    def test_refuse_what_is_none(self):
        for wrong in (([0.0, 0.0], [RIGHT, LEFT], np.zeros((2, 7))),
                      ([0.0, 1.0], [RIGHT, LEFT * np.nan], np.zeros((2, 7)))):
            with self.assertRaises(sidestep.Error):
                sidestep.Trajectory(*wrong)
        with self.assertRaises(ValueError):
            sidestep.Trajectory([0.0, 1.0], [RIGHT, LEFT], np.zeros((2, 6)))

    def test_are_written_for_others(self):
        with tempfile.TemporaryDirectory() as folder:
            table, message = (pathlib.Path(folder) / name for name in ("a.csv", "a.json"))
            self.given.write(table, PANDA)
            self.given.write(message, PANDA)
            rows = list(csv.DictReader(table.read_text().splitlines()))
            points = json.loads(message.read_text())["joint_trajectory"]["points"]
        self.assertEqual(float(rows[1]["time_s"]), 1.0)
        self.assertEqual([float(rows[0][joint.name]) for joint in PANDA.joints], list(RIGHT))
        self.assertEqual(points[1]["positions"], list(LEFT))
        self.assertEqual(points[1]["time_from_start"], {"sec": 1, "nanosec": 0})
        with self.assertRaisesRegex(sidestep.Error, "7 joints"):
            self.given.write("a.csv", SESSION.robot("hsr"))


class Planning(unittest.TestCase):
    def setUp(self):
        self.scene = SESSION.scene(BOX)
        self.field = field_of(self.scene)
        self.planner = SESSION.planner(PANDA, "gp_chain", sampler="rrt_connect", planning=FREE)

    def test_finds_ways_that_three_judges_accept(self):
        straight = sidestep.Trajectory([0.0, 2.0], [RIGHT, LEFT], np.zeros((2, 7)))
        self.assertFalse(sidestep.shape_check(PANDA, self.scene).check(straight))
        self.assertEqual(sidestep.certify(PANDA, self.scene, straight).outcome, "refuted")
        plan = self.planner.plan(self.field, RIGHT, LEFT)
        self.assertTrue(plan, plan.reason)
        np.testing.assert_allclose(plan.trajectory.positions[0], RIGHT, atol=2e-4)
        np.testing.assert_allclose(plan.trajectory.positions[-1], LEFT, atol=2e-4)
        verdict = sidestep.field_check(PANDA, self.field, FREE).check(plan.trajectory)
        self.assertTrue(verdict, str(verdict))
        shapes = sidestep.shape_check(PANDA, self.scene).check(plan.trajectory)
        self.assertTrue(shapes, str(shapes))
        self.assertGreaterEqual(shapes.min_clearance_m, 0.0)
        proof = sidestep.certify(PANDA, self.scene, plan.trajectory)
        self.assertTrue(proof, proof.outcome)
        self.assertIn("panda", proof.certificate)
        self.assertLessEqual(plan.first_ms, plan.took_ms)
        self.assertLessEqual(plan.took_ms, plan.spent_ms)

    def test_says_why_there_is_no_plan(self):
        inside = np.array([0.0, 0.6, 0.0, -1.6, 0.0, 2.2, 0.785])
        plan = self.planner.plan(self.field, RIGHT, inside, deadline_s=0.5)
        self.assertFalse(plan)
        self.assertIsNone(plan.trajectory)
        self.assertRegex(plan.reason, "^the goal is not valid: panda_.* inside an obstacle")

    def test_keeps_other_threads_running(self):
        # No way leads there: all of the deadline is used up in the planner.
        walls = {"objects": [{"name": "all", "shape": {"box": {"size_m": [0.3, 0.01, 2.0]}},
                              "pose": {"xyz_m": [0.55, 0.0, 0.9]}},
                             {"name": "back", "shape": {"box": {"size_m": [0.01, 3.0, 3.0]}},
                              "pose": {"xyz_m": [-0.25, 0.0, 0.5]}}]}
        field = field_of(SESSION.scene(walls))
        done, ticks = threading.Event(), []

        def tick():
            while not done.is_set():
                ticks.append(1)
                time.sleep(0.001)

        thread = threading.Thread(target=tick)
        interval = sys.getswitchinterval()
        sys.setswitchinterval(1000.0)  # nobody is made to hand over Python's lock
        try:
            thread.start()
            before = len(ticks)
            self.planner.plan(field, RIGHT, LEFT, deadline_s=0.3)
            during = len(ticks) - before
        finally:
            done.set()
            sys.setswitchinterval(interval)
            thread.join()
        self.assertGreater(during, 2)

    def test_can_be_asked_by_several_threads(self):
        plans = [None] * 4

        def plan(i):
            plans[i] = self.planner.plan(self.field, RIGHT, LEFT, seed=3)

        threads = [threading.Thread(target=plan, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for found in plans:
            self.assertTrue(found, found.reason)
            self.assertTrue(sidestep.shape_check(PANDA, self.scene).check(found.trajectory))

    def test_names_the_key_that_is_wrong(self):
        with self.assertRaises(sidestep.Error) as caught:
            SESSION.planner(PANDA, {"plugin": "gp_chain", "max_iteration": 3})
        self.assertEqual(caught.exception.code, "config")
        self.assertIn("optimiser", caught.exception.where)
        self.assertIn("max_iterations", str(caught.exception))
        with self.assertRaisesRegex(sidestep.Error, "no optimiser plugin 'gp_chian'"):
            SESSION.planner(PANDA, "gp_chian")
        with self.assertRaisesRegex(sidestep.Error, "planning.dt_s"):
            SESSION.planner(PANDA, "gp_chain", planning={"dt_s": "fast"})
        with self.assertRaisesRegex(ValueError, "needs an optimiser"):
            SESSION.planner(PANDA)
        with self.assertRaisesRegex(TypeError, "planning.dt_s"):
            SESSION.planner(PANDA, "gp_chain", planning={"dt_s": object()})
        with self.assertRaisesRegex(ValueError, "goal has to have 7 values"):
            self.planner.plan(self.field, RIGHT, LEFT[:3])


    def test_takes_nothing_for_something(self):
        straight = sidestep.Trajectory([0.0, 2.0], [RIGHT, LEFT], np.zeros((2, 7)))
        for call in (lambda: sidestep.field_check(None, self.field),
                     lambda: sidestep.field_check(PANDA, None),
                     lambda: sidestep.shape_check(None, self.scene),
                     lambda: sidestep.shape_check(PANDA, None),
                     lambda: sidestep.certify(None, self.scene, straight),
                     lambda: sidestep.certify(PANDA, None, straight),
                     lambda: sidestep.certify(PANDA, self.scene, None),
                     lambda: sidestep.read_problem_set("problems", None),
                     lambda: SESSION.planner(None, "gp_chain"),
                     lambda: self.planner.plan(None, RIGHT, LEFT),
                     lambda: self.planner.problem(None, RIGHT, LEFT),
                     lambda: self.planner.plan(self.field, None, LEFT),
                     lambda: PANDA.configuration(None), lambda: PANDA.link_poses(None),
                     lambda: straight.write("a.csv", None), lambda: SESSION.scene(None),
                     lambda: SESSION.robot(None), lambda: SESSION.map(None, "edt"),
                     lambda: SESSION.map({"plugin": "voxel_grid"}, "edt").integrate(None)):
            with self.assertRaises((TypeError, ValueError, sidestep.Error)):
                call()


class Configurations(unittest.TestCase):
    def test_are_read_with_what_they_build_on(self):
        with tempfile.TemporaryDirectory() as folder:
            base, file = (pathlib.Path(folder) / name for name in ("base.yaml", "of.yaml"))
            base.write_text("schema_version: 1\nplanning: {dt_s: 0.2, speed_fraction: 0.5}\n")
            file.write_text("base: base.yaml\nplanning: {dt_s: 0.1}\n")
            read = SESSION.configuration(file, ["planning.speed_fraction=0.7"])
            self.assertEqual(read["planning"], {"dt_s": 0.1, "speed_fraction": 0.7})
            file.write_text("planning: {dt_s: 0.1\nrobot: panda\n")
            with self.assertRaises(sidestep.Error) as caught:
                SESSION.configuration(file)
        self.assertRegex(caught.exception.where, r"of\.yaml:\d+")


class Upright(sidestep.Cost):
    """Pulls joint 7 to a value."""

    name = "wrist"

    def __init__(self, value, sigma=0.01):
        self.value, self.sigma = value, sigma
        self.states = 0

    def evaluate(self, q, qdot, times_s):
        self.states += len(q)
        assert q.shape == qdot.shape == (len(times_s), 7)
        jacobian = np.zeros((len(q), 1, 7))
        jacobian[:, 0, 6] = 1 / self.sigma
        return (q[:, 6:] - self.value) / self.sigma, jacobian


class Costs(unittest.TestCase):
    def setUp(self):
        self.planner = SESSION.planner(PANDA, "gp_chain", planning=FREE)
        self.field = field_of(SESSION.scene({"objects": []}))
        self.goal = RIGHT + [0.8, 0, 0, 0, 0, 0, 0]

    def middle_of(self, *costs):
        plan = self.planner.plan(self.field, RIGHT, self.goal, costs=costs)
        self.assertTrue(plan, plan.reason)
        return plan.trajectory.sample(plan.trajectory.duration_s / 2)[0]

    def test_written_in_python_bend_the_motion(self):
        self.assertAlmostEqual(self.middle_of()[6], 0.785, places=3)
        cost = Upright(1.0)
        self.assertAlmostEqual(self.middle_of(cost)[6], 1.0, delta=0.02)
        self.assertGreater(cost.states, 0)

    def test_are_half_the_sum_of_squares(self):
        problems = [self.planner.problem(self.field, RIGHT, self.goal, costs=costs)
                    for costs in ([], [Upright(1.0, sigma=0.5)])]
        n = problems[0].support_states
        times_s = problems[0].dt_s * np.arange(n)
        share = np.linspace(0, 1, n)[:, None]
        line = sidestep.Trajectory(times_s, RIGHT + share * (self.goal - RIGHT),
                                   np.tile((self.goal - RIGHT) / times_s[-1], (n, 1)))
        without, within = (problem.cost(line) for problem in problems)
        one = 0.5 * ((0.785 - 1.0) / 0.5) ** 2
        states = round((within - without) / one)
        self.assertGreaterEqual(states, n - 2)
        self.assertAlmostEqual(within - without, states * one, delta=1e-9 * within)

    def test_that_throw_are_named(self):
        class Broken(Upright):
            def evaluate(self, q, qdot, times_s):
                raise KeyError("no such sensor")

        class Narrow(Upright):
            def evaluate(self, q, qdot, times_s):
                return np.zeros((len(q), 2)), np.zeros((len(q), 1, 7))

        class Textual(Upright):
            def evaluate(self, q, qdot, times_s):
                return [["a"]] * len(q), None

        class Silent(Upright):
            def evaluate(self, q, qdot, times_s):
                return ()

        for cost, said in ((Broken(1.0), "plugin cost Broken: threw: KeyError: 'no such sensor'"),
                           (Narrow(1.0), r"cost Narrow.*residuals have to be \d+ x 1, and are \d+ x 2"),
                           (Textual(1.0), "cost Textual.*residuals has to be numbers"),
                           (Silent(1.0), "cost Silent.*returns no residuals")):
            with self.subTest(said), self.assertRaisesRegex(sidestep.Error, said):
                self.planner.plan(self.field, RIGHT, self.goal, costs=[cost])
        self.middle_of()  # the planner is as it was

    def test_that_are_none_are_refused(self):
        with self.assertRaises((AttributeError, TypeError)):
            self.planner.plan(self.field, RIGHT, self.goal, costs=[object()])
        cost = Upright(1.0)
        cost.residual_count = 0
        with self.assertRaisesRegex(ValueError, "residual_count"):
            self.planner.plan(self.field, RIGHT, self.goal, costs=[cost])


class Straight(sidestep.Optimiser):
    def solve(self, problem, initial, deadline_s):
        assert 0 < deadline_s < 10
        n = problem.support_states
        times_s = problem.dt_s * np.arange(n)
        share = 3 * np.linspace(0, 1, n)[:, None] ** 2 - 2 * np.linspace(0, 1, n)[:, None] ** 3
        rate = 6 * (share * 0 + np.linspace(0, 1, n)[:, None] * (1 - np.linspace(0, 1, n)[:, None]))
        way = problem.goal - problem.start
        return sidestep.Trajectory(times_s, problem.start + share * way, rate * way / times_s[-1])


class Optimisers(unittest.TestCase):
    def test_written_in_python_plan(self):
        planner = SESSION.planner(PANDA, Straight(), planning=FREE)
        goal = RIGHT + [0.8, 0, 0, 0, 0, 0, 0]
        plan = planner.plan(field_of(SESSION.scene({"objects": []})), RIGHT, goal)
        self.assertTrue(plan, plan.reason)
        np.testing.assert_allclose(plan.trajectory.positions[-1], goal, atol=2e-4)
        # What it proposes is judged as that of any other.
        plan = planner.plan(field_of(SESSION.scene(BOX)), RIGHT, LEFT, deadline_s=0.5)
        self.assertFalse(plan)

    def test_cannot_ask_the_planner_that_asks_them(self):
        class Asking(sidestep.Optimiser):
            def solve(self, problem, initial, deadline_s):
                return self.planner.plan(problem.field, problem.start, problem.goal).trajectory

        asking = Asking()
        planner = asking.planner = SESSION.planner(PANDA, asking, planning=FREE)
        with self.assertRaisesRegex(sidestep.Error, "cannot be asked by .* while it is planning"):
            planner.plan(field_of(SESSION.scene({"objects": []})), RIGHT, RIGHT + 0.01)

    def test_that_fail_are_named(self):
        class Lost(sidestep.Optimiser):
            answer = None

            def solve(self, problem, initial, deadline_s):
                if isinstance(self.answer, Exception):
                    raise self.answer
                return self.answer

        field = field_of(SESSION.scene({"objects": []}))
        lost = Lost()
        planner = SESSION.planner(PANDA, lost, planning=FREE)
        plan = planner.plan(field, RIGHT, RIGHT + 0.01, deadline_s=0.5)
        self.assertFalse(plan)
        self.assertIn("found none", plan.reason)
        other = sidestep.Trajectory([0.0, 1.0], np.zeros((2, 3)), np.zeros((2, 3)))
        for lost.answer, said in ((ZeroDivisionError("by nothing"), "Lost.*by nothing"),
                                  ("a way", "Lost.*has to return a Trajectory or None"),
                                  (other, "Lost.*3 joints")):
            with self.subTest(said), self.assertRaisesRegex(sidestep.Error, said):
                planner.plan(field, RIGHT, RIGHT + 0.01, deadline_s=0.5)


if __name__ == "__main__":
    unittest.main()
