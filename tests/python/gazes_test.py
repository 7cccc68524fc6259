"""Heads that closed loops turn."""

import unittest

import numpy as np
import sidestep

import world

SESSION = sidestep.Session()
HSR = SESSION.robot("hsr")
STANDING = HSR.configuration({"pose": "drive", "joints": dict.fromkeys(
    ["odom_x", "odom_y", "odom_t"], 0.0)})
EMPTY = SESSION.scene({"objects": []}).field([-1, -2, 0], [5, 2, 2])
RADIUS_M = 0.25  # of a person


def rotation(axis, angle_rad):
    """About a unit vector (Rodrigues), 4 x 4."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned = np.eye(4)
    turned[:3, :3] += np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross
    return turned


def camera_of_hsr(pan_rad, tilt_rad):
    """By the joints of its URDF: pan about z, then, 20 mm ahead, tilt about -y."""
    poses = HSR.link_poses(STANDING)
    torso, tilt, camera = (poses[HSR.links.index(name)] for name in (
        "torso_lift_link", "head_tilt_link", "head_rgbd_sensor_link"))
    ahead = np.eye(4)
    ahead[0, 3] = 0.02
    return (torso @ rotation([0, 0, 1], pan_rad) @ ahead @ rotation([0, -1, 0], tilt_rad)
            @ np.linalg.inv(tilt) @ camera)


class Headless(sidestep.Executor):
    """A robot that stands."""

    now_s = 0.0

    def current(self):
        return STANDING, np.zeros(HSR.dof), self.now_s

    def follow(self, trajectory, start_s):
        raise AssertionError("it is at its goal")

    def stop(self):
        pass


class Stands(Headless):
    """It turns its head as told."""

    def __init__(self):
        self.angles, self.turns = (0.0, -0.3), 0

    def head(self):
        return self.angles

    def turn_head(self, pan_rad, tilt_rad):
        self.angles, self.turns = (pan_rad, tilt_rad), self.turns + 1


class Gazes(unittest.TestCase):
    AT_M = np.array([0.3, 1.6])  # beside the robot, where its camera does not look
    MAPPER = dict(world.MAPPER, origin_m=[-2.5, -2.5, 0.0])

    def loop_of(self, robot, gaze, **more):
        return SESSION.loop(HSR, robot, "gp_chain", STANDING, planning={"unknown": "free"}, gaze=gaze,
                            **more)

    def look_around(self, gaze, motion="ignored"):
        """For two seconds, with images from where the head is; the robot, and how many voxels of the
        person are in the map."""
        robot, seen = Stands(), SESSION.map(self.MAPPER, world.FIELD, motion=motion)
        loop = self.loop_of(robot, gaze)
        for k in range(20):
            robot.now_s = 0.1 * k
            T_world_camera = camera_of_hsr(*robot.angles)
            depth_m = world.depth_of(T_world_camera, self.AT_M, RADIUS_M)
            seen.integrate(sidestep.Frame(depth_m, world.CAMERA, T_world_camera, robot.now_s))
            loop.step(robot.now_s, seen.snapshot)
        occupied = np.argwhere(seen.occupied())
        centres_m = np.array(self.MAPPER["origin_m"]) + 0.05 * (occupied + 0.5)
        of_person = (np.hypot(*(centres_m[:, :2] - self.AT_M).T) < RADIUS_M + 0.1) & (
            centres_m[:, 2] > 0.3)
        return robot, np.count_nonzero(of_person)

    def test_written_in_python_turn_the_head_and_show_who_stands_there(self):
        class Listening(sidestep.Gaze):
            """Looks at who spoke."""

            def look(self, request):
                self.request, self.at = request, request.at
                self.may, self.snapshot = request.may(*request.rest), request.snapshot
                self.camera = request.T_world_camera(0.4, -0.1)
                self.q = request.q
                return request.towards([*Gazes.AT_M, 1.2])

        gaze = Listening()
        robot, voxels = self.look_around(gaze)
        self.assertGreater(voxels, 20)
        self.assertEqual(robot.turns, 2)  # told once more after a second
        # The middle of the image is where the gaze wanted it.
        x, y, z, _ = np.linalg.inv(camera_of_hsr(*robot.angles)) @ [*self.AT_M, 1.2, 1.0]
        self.assertGreater(z, 1.0)
        np.testing.assert_allclose([x / z, y / z], [0.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(gaze.camera, camera_of_hsr(0.4, -0.1), atol=1e-9)
        self.assertEqual(gaze.at, robot.angles)
        self.assertIs(gaze.may, True)
        np.testing.assert_array_equal(gaze.q, STANDING)
        self.assertAlmostEqual(gaze.snapshot.field.stamp_s, 1.9)
        with self.assertRaisesRegex(RuntimeError, "over when look"):
            gaze.request.at  # pylint: disable=pointless-statement
        # Nobody is seen by a head that rests, whoever has it rest.
        for gaze in (None, "fixed"):
            robot, voxels = self.look_around(gaze)
            self.assertEqual(voxels, 0)

    def test_of_plugins_turn_the_head(self):
        robot, _ = self.look_around("scan")
        self.assertGreater(robot.turns, 5)
        self.assertNotEqual(robot.angles, (0.0, -0.3))

    def test_that_answer_amiss_are_named_and_the_head_stays(self):
        class Odd(sidestep.Gaze):
            answer = None

            def look(self, request):
                if isinstance(self.answer, Exception):
                    raise self.answer
                return self.answer

        numbers = r"look\(\) has to return pan and tilt, two numbers, and returns "
        for answer, said in ((ZeroDivisionError("by nothing"), "by nothing(.|\n)*look"),
                             (None, numbers + "none"), ("left", numbers + "none"),
                             ([0.1], numbers + "1"), ([0.1, 0.2, 0.3], numbers + "3"),
                             ([[0.1, 0.2]], numbers + "1 x 2"),
                             ([np.nan, 0.0], numbers + "what is not finite"),
                             ([0.0, np.inf], numbers + "what is not finite")):
            robot, gaze = Stands(), Odd()
            gaze.answer = answer
            loop = self.loop_of(robot, gaze)
            with self.subTest(said):
                with self.assertRaisesRegex(sidestep.Error, "gaze Odd(.|\n)*" + said):
                    loop.step(0.0, EMPTY)
                self.assertEqual(robot.turns, 0)
                gaze.answer, robot.now_s = (0.2, -0.2), 0.1
                loop.step(0.1)
                self.assertEqual(robot.angles, (0.2, -0.2))

    def test_need_a_head_that_turns(self):
        class Stiff(Stands):
            def turn_head(self, pan_rad, tilt_rad):
                raise ConnectionError("no neck")

        class Lost(Stands):
            def head(self):
                return 0.0

        for robot, said in ((Stiff(), "executor Stiff(.|\n)*no neck"),
                            (Lost(), r"executor Lost(.|\n)*head\(\) has to return pan and tilt")):
            with self.subTest(said), self.assertRaisesRegex(sidestep.Error, said):
                self.loop_of(robot, "scan").step(0.0, EMPTY)
        with self.assertRaisesRegex(TypeError, r"no head\(\)"):
            self.loop_of(Headless(), "scan")
        point = SESSION.robot({"plugin": "point", "radius_m": 0.2})
        with self.assertRaisesRegex(sidestep.Error, "head"):
            SESSION.loop(point, Stands(), "gp_chain", [4.0, 0.0], gaze="scan")

        class Meeting(sidestep.Gaze):
            wants_tracks = True

        with self.assertRaisesRegex(sidestep.Error, 'gaze Meeting has no tracks.*"tracked"'):
            self.loop_of(Stands(), Meeting()).step(0.0, EMPTY)
        # What is raised comes after the step: its events come with the next one.
        robot, gaze = Stands(), Meeting()
        gaze.wants_tracks = False
        loop = self.loop_of(robot, gaze)
        with self.assertRaisesRegex(sidestep.Error, "gaze Meeting(.|\n)*NotImplementedError"):
            loop.step(0.0, EMPTY)
        self.assertEqual(loop.status, "reached")
        self.assertEqual([event.kind for event in loop.step(0.05)], ["reached"])

if __name__ == "__main__":
    unittest.main()
