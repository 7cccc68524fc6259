"""Closed loops that are stepped here: a disc that goes where it is told to."""

import gc
import threading
import time
import unittest

import numpy as np
import sidestep

import world

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


EMPTY = scene_of().field([-1, -2, 0], [5, 2, 2])
PERSON_RADIUS_M = 0.25


def walker(position_m, velocity_mps=(0.0, 0.0), stamp_s=0.0, number=7, **more):
    return sidestep.Track(number, position_m, velocity_mps, PERSON_RADIUS_M, 1.8, stamp_s, **more)


class Straight(sidestep.Predictor):
    """Whoever is tracked keeps the velocity; what is not known of that makes sets wider."""

    noise = 0.1

    def predict(self, request):
        self.request = request
        return [self.set_of(track, request.horizon_s) for track in request.tracks]

    def set_of(self, track, horizon_s):
        times_s = np.append(np.arange(0, horizon_s - 1e-9, 0.25), horizon_s)
        # Of a position that begins apart from its velocity, under white noise.
        place, speed = track.covariance[0, 0], track.covariance[2, 2]
        sigmas_m = np.sqrt(place + times_s ** 2 * speed + self.noise ** 2 * times_s ** 3 / 3)
        return sidestep.PredictedSet(track, times_s,
                                     track.position_m + times_s[:, None] * track.velocity_mps,
                                     track.radius_m + sigmas_m)


class Predictors(unittest.TestCase):
    def loop_of(self, predictor, disc=None, **more):
        return SESSION.loop(DISC, disc or Disc(), "gp_chain", [4.0, 0.0], planning=PLANNING,
                            predictor=predictor, **more)

    def test_written_in_python_say_what_the_built_in_one_says(self):
        tracks = [walker([2.0, -1.0], [0.3, 0.4], covariance=np.diag([0.01, 0.01, 0.004, 0.004])),
                  walker([3.0, 1.0], number=3, bottom_m=0.1)]
        seen = sidestep.Snapshot(EMPTY, tracks)
        self.assertEqual([track.id for track in seen.tracks], [3, 7])
        straight = Straight()
        loops = [self.loop_of(straight),
                 self.loop_of({"plugin": "constant_velocity", "max_growth_m": 100.0})]
        for loop in loops:
            self.assertIsNone(loop.prediction)
            loop.step(0.0, seen)
        mine, built_in = (loop.prediction for loop in loops)
        self.assertEqual([s.track for s in mine], [3, 7])
        for one, other in zip(mine, built_in):
            self.assertEqual((one.track, one.bottom_m, one.top_m, one.likelihood),
                             (other.track, other.bottom_m, other.top_m, other.likelihood))
            self.assertEqual(one.knots.shape, (25, 4))
            np.testing.assert_allclose(one.knots, other.knots, atol=1e-9)
        np.testing.assert_allclose(mine[1].knots[4, :3], [1.0, 2.3, -0.6], atol=1e-12)
        request = straight.request
        self.assertEqual((request.stamp_s, request.horizon_s), (0.0, 6.0))
        position_m, velocity_mps, radius_m = request.robot
        del loops, loop, seen
        gc.collect()
        np.testing.assert_array_equal([*position_m, *velocity_mps], np.zeros(4))
        self.assertAlmostEqual(radius_m, RADIUS_M)
        # What it was asked is its own, and outlives the loop; views outlive what they are of.
        np.testing.assert_array_equal(request.field.distance([[1.0, 0, 1]]),
                                      EMPTY.distance([[1.0, 0, 1]]))
        at_m = request.tracks[1].position_m
        del request, straight.request
        gc.collect()
        np.testing.assert_array_equal(at_m, [2.0, -1.0])
        with self.assertRaises(ValueError):
            at_m[0] = 0.0

    def least_gap_m(self, predictor):
        """Of a disc to somebody who crosses its way and is in no field."""
        disc, least_m = Disc(), np.inf
        loop = self.loop_of(predictor, disc, sampler="rrt_connect")
        for k in range(600):
            disc.now_s = k * STEP_S
            at_m = np.array([2.0, -1.6 + 0.4 * disc.now_s])
            seen = None
            if k % 5 == 0:
                field = scene_of().field([-1, -2, 0], [5, 2, 2], disc.now_s)
                seen = sidestep.Snapshot(field, [walker(at_m, [0.0, 0.4], disc.now_s)])
            loop.step(disc.now_s, seen)
            least_m = min(least_m, np.linalg.norm(disc.state()[0] - at_m)
                          - RADIUS_M - PERSON_RADIUS_M)
        return least_m

    def test_are_kept_clear_of(self):
        self.assertGreater(self.least_gap_m(Straight()), 0.0)
        self.assertLess(self.least_gap_m(None), 0.0)  # somebody really is in the way

    def test_have_the_optimiser_bend_around_what_is_in_no_field(self):
        disc = Disc()
        loop = self.loop_of(Straight(), disc)
        stands = walker([2.0, 0.2])
        for k in range(1000):
            disc.now_s = k * STEP_S
            field = scene_of().field([-1, -2, 0], [5, 2, 2], disc.now_s)
            loop.step(disc.now_s, sidestep.Snapshot(field, [stands]) if k % 5 == 0 else None)
            if loop.status == "reached":
                break
        self.assertEqual(loop.status, "reached")

    def test_that_answer_amiss_are_named_and_the_worst_is_assumed(self):
        def of(**change):
            knots = {"times_s": [0.0, 6.0], "centres_m": np.zeros((2, 2)), "radii_m": [0.3, 0.3],
                     **change}
            return lambda request: [sidestep.PredictedSet(request.tracks[0], **knots)]

        def threw(request):
            raise KeyError("no such model")

        other = sidestep.PredictedSet(walker([0.0, 0.0], number=9), [0.0, 6.0], np.zeros((2, 2)),
                                      [1.0, 1.0])
        cases = (
            (threw, "KeyError: 'no such model'(.|\n)*predict"),
            (lambda request: None, r"predict\(\) has to return PredictedSets, and returns NoneType"),
            (lambda request: 3.0, r"predict\(\) has to return PredictedSets, and returns float"),
            (lambda request: [1], r"predict\(\) has to return PredictedSets, and returns int"),
            (lambda request: [], r"predict\(\): track 7 has no set"),
            (lambda request: of()(request) + [other], r"predict\(\): .*track 9 is of none"),
            (lambda request: 2 * of()(request), r"predict\(\): the likelihoods of track 7 sum to 2"),
            (of(times_s=[0.5, 6.0]), r"predict\(\): .*track 7 begins late"),
            (of(times_s=[0.0, 5.0]), r"predict\(\): .*track 7 ends after 5 s"),
            (of(times_s=[6.0, 0.0]), r"predict\(\): .*track 7"),
            (of(radii_m=[0.3, np.nan]), r"predict\(\): .*track 7"),
            (of(radii_m=[0.3, -0.1]), r"predict\(\): .*track 7"),
            (of(centres_m=[[0.0, np.inf], [0.0, 0.0]]), r"predict\(\): .*track 7"),
            (of(likelihood=0.0), r"predict\(\): .*track 7"),
            (of(radii_m=[0.3]), r"have to be n, n x 2 and n, and are 2, 2 x 2 and 1(.|\n)*predict"),
            (of(centres_m=np.zeros((2, 3))), "are 2, 2 x 3 and 2(.|\n)*predict"),
            (of(radii_m=["a", "b"]), "TypeError(.|\n)*predict"))
        for answer, said in cases:
            class Odd(sidestep.Predictor):
                def predict(self, request, answer=answer):
                    return answer(request)

            disc = Disc()
            loop = self.loop_of(Odd(), disc)
            with self.subTest(said):
                with self.assertRaisesRegex(sidestep.Error, "predictor Odd(.|\n)*" + said) as caught:
                    loop.step(0.0, sidestep.Snapshot(EMPTY, [walker([2.0, 1.5])]))
                self.assertIn(caught.exception.code, ("plugin", "invalid_argument"))
                # Whoever is tracked may have walked anywhere at 1.6 m/s.
                np.testing.assert_allclose(
                    loop.prediction[0].knots[[0, -1]],
                    [[0, 2.0, 1.5, PERSON_RADIUS_M], [6, 2.0, 1.5, PERSON_RADIUS_M + 9.6]],
                    atol=1e-9)
                disc.now_s = STEP_S
                loop.step(STEP_S)  # it goes on

    def test_get_the_tracks_that_they_need(self):
        with self.assertRaisesRegex(sidestep.Error, 'predictor Straight has no tracks.*"apart"'):
            self.loop_of(Straight()).step(0.0, EMPTY)
        with self.assertRaisesRegex(AttributeError, "subject"):
            self.loop_of(type("Half", (), {"predict": None})())
        odd = Straight()
        odd.subject = "all"
        with self.assertRaisesRegex(ValueError, "subject has to be"):
            self.loop_of(odd)
        with self.assertRaisesRegex(sidestep.Error, "no predictor plugin 'constant_speed'"):
            self.loop_of("constant_speed")
        with self.assertRaisesRegex(sidestep.Error, "track 7"):
            sidestep.Snapshot(EMPTY, [walker([np.nan, 0.0])])

        class Nobody(sidestep.Predictor):
            subject = "things"

            def predict(self, request):
                return []

        loop = self.loop_of(Nobody())  # it needs none
        loop.step(0.0, EMPTY)
        self.assertEqual(loop.prediction, [])

    def test_that_hang_have_the_robot_stopped_meanwhile(self):
        class Stopping(Disc):
            def __init__(self):
                super().__init__()
                self.stopped, self.by = threading.Event(), None

            def stop(self):
                self.by = threading.current_thread()
                self.stopped.set()

        class Waiting(Straight):
            def predict(self, request):
                self.is_over = disc.stopped.wait(60.0)
                return super().predict(request)

        disc, waiting = Stopping(), Waiting()
        loop = self.loop_of(waiting, disc, wall_clock=True)
        loop.step(0.0, sidestep.Snapshot(EMPTY, [walker([2.0, 1.5])]))
        self.assertTrue(waiting.is_over)
        self.assertIsNot(disc.by, threading.main_thread())
        del loop  # whoever watched goes with it

    def test_pass_on_an_interrupt(self):
        class Interrupted(Straight):
            def predict(self, request):
                raise KeyboardInterrupt

        loop = self.loop_of(Interrupted())
        with self.assertRaises(KeyboardInterrupt):
            with self.assertRaisesRegex(sidestep.Error, "predictor Interrupted.*KeyboardInterrupt"):
                loop.step(0.0, sidestep.Snapshot(EMPTY, [walker([2.0, 1.5])]))
            for _ in range(1000):
                time.sleep(0)

    def test_cannot_step_their_loop(self):
        class Eager(Straight):
            def predict(self, request):
                self.loop.step(0.1)

        eager = Eager()
        eager.loop = self.loop_of(eager)
        with self.assertRaisesRegex(sidestep.Error, "predictor Eager.*cannot be stepped by its own"):
            eager.loop.step(0.0, sidestep.Snapshot(EMPTY, [walker([2.0, 1.5])]))


class Tracking(unittest.TestCase):
    def walk(self, motion):
        """Somebody crosses the view of a camera at 0.8 m/s; the map afterwards, and where they are."""
        seen = SESSION.map(world.MAPPER, world.FIELD, motion=motion)
        self.assertIsNone(seen.snapshot)
        for k in range(26):
            at_m = np.array([2.0, -1.0 + 0.08 * k])
            depth_m = world.depth_of(world.T_WORLD_CAMERA, at_m, PERSON_RADIUS_M, wall_m=3.9)
            field = seen.integrate(world.frame(depth_m, 0.1 * k))
        self.assertEqual(field.sequence, seen.snapshot.field.sequence)
        np.testing.assert_array_equal(seen.snapshot.T_world_camera, world.T_WORLD_CAMERA)
        return seen.snapshot, at_m

    def test_is_done_as_far_as_asked_for(self):
        for motion, has_moving, has_tracks in (("ignored", False, False), ("detected", True, False),
                                               ("tracked", True, True), ("apart", True, True)):
            with self.subTest(motion):
                snapshot, at_m = self.walk(motion)
                self.assertEqual(snapshot.moving is not None, has_moving)
                self.assertEqual(snapshot.tracks is not None, has_tracks)
                if has_moving:
                    gaps_m = np.linalg.norm(snapshot.moving[:, :2] - at_m, axis=1)
                    self.assertLess(gaps_m.min(), 0.5)
                if has_tracks:
                    track, = snapshot.tracks
                    np.testing.assert_allclose(track.position_m, at_m, atol=0.15)
                    np.testing.assert_allclose(track.velocity_mps, [0.0, 0.8], atol=0.2)
                    self.assertEqual(track.last_seen_s, 2.5)
                # Their front is in the field, unless they are left out of it.
                front_m = float(snapshot.field.distance([[at_m[0] - 0.25, at_m[1], 1.0]])[0])
                if motion == "apart":
                    self.assertGreater(front_m, 0.3)
                else:
                    self.assertLess(front_m, 0.1)

    def test_needs_what_goes_with_it(self):
        apart, _ = self.walk("apart")
        for predictor in (None, "none"):
            loop = SESSION.loop(DISC, Disc(), "gp_chain", [4.0, 0.0], predictor=predictor)
            with self.assertRaisesRegex(sidestep.Error, "not in this map's field"):
                loop.step(2.5, apart)
        for replanner in ({"obstacle_speed_mps": 1.0}, {"safety": "ssm"}):
            loop = SESSION.loop(DISC, Disc(), "gp_chain", [4.0, 0.0], replanner=replanner)
            with self.assertRaisesRegex(sidestep.Error, 'not tell what moves.*"detected"'):
                loop.step(0.0, EMPTY)
            loop.step(2.5, self.walk("tracked")[0])
        with self.assertRaisesRegex(ValueError, '"apart"'):
            SESSION.map(world.MAPPER, world.FIELD, motion="none")


if __name__ == "__main__":
    unittest.main()
