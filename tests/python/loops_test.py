"""Closed loops that are stepped here, of a disc that goes where it is told to."""

import unittest

import numpy as np
import sidestep

SESSION = sidestep.Session()
RADIUS_M = 0.2
DISC = SESSION.robot({"plugin": "point", "radius_m": RADIUS_M, "max_velocity_mps": 0.6,
                      "max_acceleration_mps2": 1.0})
PLANNING = {"unknown": "free", "outside": "occupied", "dt_s": 0.25, "epsilon_m": 0.15,
            "sigma_obstacle": 0.01}
STEP_S = 0.02


class Disc(sidestep.Executor):
    """Follows to the letter; stops at 1 m/s^2 along its way."""

    def __init__(self):
        self.now_s, self.trajectory, self.start_s = 0.0, None, 0.0
        self.stops = 0

    def state(self):
        if self.trajectory is None:
            return np.array([0.0, 0.0]), np.zeros(2)
        return self.trajectory.sample(self.now_s - self.start_s)

    def current(self):
        return (*self.state(), self.now_s)

    def follow(self, trajectory, start_s):
        self.trajectory, self.start_s = trajectory, start_s

    def stop(self):
        self.stops += 1
        q, qdot = self.state()
        speed = np.linalg.norm(qdot)
        times_s = np.array([0.0, max(speed, 1e-3)])
        self.follow(sidestep.Trajectory(times_s, [q, q + 0.5 * times_s[1] * qdot],
                                        [qdot, np.zeros(2)]), self.now_s)


def scene_of(*boxes):
    """Boxes from the floor up: x, y and their size along both."""
    return SESSION.scene({"objects": [
        {"name": f"box {i}", "shape": {"box": {"size_m": [*size_m, 2.0]}},
         "pose": {"xyz_m": [*at_m, 1.0]}} for i, (at_m, size_m) in enumerate(boxes)]})


def gap_to(boxes, q):
    """From a point to the nearest of the boxes."""
    outside = [np.maximum(np.abs(q - at_m) - np.array(size_m) / 2, 0) for at_m, size_m in boxes]
    return min((float(np.linalg.norm(o)) for o in outside), default=np.inf)


class Loops(unittest.TestCase):
    def run_loop(self, boxes_at, last_s=30.0, disc=None, optimiser="gp_chain"):
        """Boxes are a function of time. The loop, all events, and the least gap to what stands there."""
        disc = disc or Disc()
        loop = SESSION.loop(DISC, disc, optimiser, [4.0, 0.0], sampler="rrt_connect",
                            planning=PLANNING, replanner={"margin_m": 0.02})
        events, least_m = [], np.inf
        for k in range(round(last_s / STEP_S)):
            disc.now_s = k * STEP_S
            boxes = boxes_at(disc.now_s)
            field = None
            if k % 5 == 0:
                field = scene_of(*boxes).field([-1, -2, 0], [5, 2, 2], disc.now_s)
            events += loop.step(disc.now_s, field)
            if disc.trajectory is not None:
                least_m = min(least_m, gap_to(boxes, disc.state()[0]))
            if loop.status == "reached":
                break
        return loop, disc, events, least_m

    def test_go_round_what_comes_into_the_way(self):
        box = ([2.0, 0.1], [0.4, 0.8])
        loop, disc, events, least_m = self.run_loop(lambda now_s: [box] if now_s > 1.0 else [])
        self.assertEqual(loop.status, "reached", events)
        np.testing.assert_allclose(disc.state()[0], [4.0, 0.0], atol=0.03)
        self.assertGreaterEqual(least_m, RADIUS_M)
        kinds = [event.kind for event in events]
        self.assertEqual(kinds[0], "planned")
        self.assertIn("replanned", kinds)
        self.assertEqual(kinds[-1], "reached")
        self.assertTrue(any("box" in event.cause or "obstacle" in event.cause for event in events))

    def test_stop_before_a_wall_and_wait(self):
        wall = ([2.0, 0.0], [0.2, 4.2])
        loop, disc, events, least_m = self.run_loop(
            lambda now_s: [wall] if now_s > 1.0 else [], last_s=8.0)
        self.assertEqual(loop.status, "waiting")
        self.assertGreaterEqual(least_m, RADIUS_M)
        self.assertLess(np.abs(disc.state()[1]).max(), 1e-6)
        self.assertIn("stopped", [event.kind for event in events])

    def test_go_on_when_the_wall_is_gone(self):
        wall = ([2.0, 0.0], [0.2, 4.2])
        loop, _, events, least_m = self.run_loop(lambda now_s: [wall] if 1.0 < now_s < 6.0 else [])
        self.assertEqual(loop.status, "reached", events)
        self.assertGreaterEqual(least_m, RADIUS_M)

    def test_end_where_they_are_told_to(self):
        disc = Disc()
        loop = SESSION.loop(DISC, disc, "gp_chain", [4.0, 0.0], planning=PLANNING)
        for k in range(100):
            disc.now_s = k * STEP_S
            loop.step(disc.now_s, scene_of().field([-1, -2, 0], [5, 2, 2], disc.now_s))
        self.assertGreater(np.linalg.norm(disc.state()[1]), 0.1)
        events = loop.stop(disc.now_s, "enough")
        self.assertEqual((events[0].kind, events[0].cause), ("stopped", "enough"))
        disc.now_s += 2.0
        self.assertLess(np.linalg.norm(disc.state()[1]), 1e-6)

    def test_name_robots_that_fail(self):
        class Silent(Disc):
            def current(self):
                if self.now_s > 1.0:
                    raise ConnectionError("no odometry")
                return super().current()

        loop, _, events, _ = self.run_loop(lambda now_s: [], last_s=2.0, disc=Silent())
        self.assertNotEqual(loop.status, "reached")
        self.assertTrue(any("executor Silent" in e.cause and "no odometry" in e.cause
                            for e in events), events)

        class Odd(Disc):
            def current(self):
                return np.zeros(2)

        _, _, events, _ = self.run_loop(lambda now_s: [], last_s=0.5, disc=Odd())
        self.assertTrue(any("current() has to return" in e.cause for e in events), events)

    def test_cannot_be_stepped_by_their_robots(self):
        class Eager(Disc):
            def current(self):
                self.loop.step(self.now_s)
                return super().current()

        disc = Eager()
        loop = disc.loop = SESSION.loop(DISC, disc, "gp_chain", [4.0, 0.0], planning=PLANNING)
        events = loop.step(0.0, scene_of().field([-1, -2, 0], [5, 2, 2], 0.0))
        self.assertTrue(any("cannot be stepped by its own robot" in e.cause for e in events), events)

    def test_are_made_of_what_fits(self):
        with self.assertRaisesRegex(TypeError, r"no follow\(\)"):
            SESSION.loop(DISC, type("Half", (), {"current": None})(), "gp_chain", [4.0, 0.0])
        with self.assertRaisesRegex(sidestep.Error, "replanner.*replan_period_s"):
            SESSION.loop(DISC, Disc(), "gp_chain", [4.0, 0.0], replanner={"replan_periods": 1})
        with self.assertRaisesRegex(ValueError, "goal has to have 2 values"):
            SESSION.loop(DISC, Disc(), "gp_chain", [4.0])


if __name__ == "__main__":
    unittest.main()
