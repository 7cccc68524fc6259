"""What is given amiss: refused with words, never taken for something else."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import sidestep

import world

SESSION = sidestep.Session()
PANDA = SESSION.robot("panda")
REST = PANDA.configuration("ready")
EMPTY = SESSION.scene({"objects": []}).field([-2] * 3, [2] * 3)


def nested(levels):
    """A number in that many lists."""
    value = 1
    for _ in range(levels):
        value = [value]
    return value


class Blocks(unittest.TestCase):
    def test_end_where_files_have_to(self):
        # A crash would take the test along: each has an interpreter of its own.
        for made, where in (("a = {}; a['a'] = a", r"scene(\.a){27}\.\.\."),
                            ("b = []; b.append(b); a = {'objects': b}", r"scene\.objects(\[0\])+"),
                            ("b = 1\nfor _ in range(100000): b = [b]\na = {'b': b}", r"scene\.b(\[0\])+"),
                            ("import numpy as np; b = np.empty(1, object); b[0] = b; a = {'b': b}",
                             r"scene\.b(\[0\])*")):
            said = subprocess.run(
                [sys.executable, "-c", f"import sidestep\n{made}\nsidestep.Session().scene(a)"],
                capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual(said.returncode, 1, said.stderr[-300:])
            self.assertRegex(said.stderr.splitlines()[-1], "^ValueError: " + where + ".*nested too deeply")

    def test_end_at_the_level_where_files_do(self):
        with tempfile.TemporaryDirectory() as folder:
            for levels, is_too_deep in ((98, False), (99, True)):  # and the dict, and the number
                file = pathlib.Path(folder) / f"{levels}.yaml"
                file.write_text("objects: " + "[" * levels + "1" + "]" * levels)
                with self.assertRaises(sidestep.Error) as of_file:
                    SESSION.scene(file)
                self.assertEqual("nested too deeply" in str(of_file.exception), is_too_deep)
                with self.assertRaises(ValueError if is_too_deep else sidestep.Error):
                    SESSION.scene({"objects": nested(levels)})

    def test_do_not_grow_without_end(self):
        value = [1]
        for _ in range(30):
            value = [value, value]
        with self.assertRaisesRegex(ValueError, "too large, of more than 1000000 values"):
            SESSION.scene({"objects": value})


class Arrays(unittest.TestCase):
    def test_are_of_numbers(self):
        point = [[0.0, 0.0, 0.0]]
        for of in (complex, bool, object, "datetime64[s]", str):
            wrong = np.array(point).astype(float).astype("i8").astype(of)
            row = wrong[0]
            for call in (lambda: EMPTY.distance(wrong), lambda: EMPTY.query(wrong),
                         lambda: PANDA.link_poses(np.zeros(7).astype("i8").astype(of)),
                         lambda: SESSION.scene("room").signed_distance(row),
                         lambda: SESSION.scene("room").field(row, [1, 1, 1]),
                         lambda: sidestep.Track(1, row[:2], [0, 0], 0.3, 1.8, 0.0),
                         lambda: sidestep.Trajectory([0.0, 1.0], [[0.0], [1.0]],
                                                     np.zeros((2, 1)).astype("i8").astype(of)),
                         lambda: PANDA.configuration(np.zeros(7).astype("i8").astype(of)),
                         lambda: sidestep.Frame(world.depth_of_pillar(), world.CAMERA,
                                                np.eye(4).astype("i8").astype(of))):
                with self.subTest(str(of)), self.assertRaisesRegex(TypeError, "has to be numbers"):
                    call()
        self.assertEqual(len(EMPTY.distance(np.zeros((2, 3), np.int32))), 2)
        self.assertEqual(len(EMPTY.distance([[0, 0, 1]])), 1)

    def test_are_of_the_right_shape(self):
        scene = SESSION.scene("room")
        for call, said in ((lambda: scene.signed_distance([1.0, 2.0]), "point_m has to be 3 numbers, and is 2"),
                           (lambda: scene.field([[0, 0, 0]], [1, 1, 1]), "lower_m.*is 1 x 3"),
                           (lambda: sidestep.Track(1, [0.0] * 3, [0, 0], 0.3, 1.8, 0.0), "position_m.*is 3"),
                           (lambda: sidestep.Frame(world.depth_of_pillar(), world.CAMERA, np.eye(3)),
                            "T_world_camera has to be 4 x 4 numbers, and is 3 x 3"),
                           (lambda: sidestep.Track(1, [0, 0], [0, 0], 0.3, 1.8, 0.0,
                                                   covariance=np.eye(2)), "covariance.*2 x 2")):
            with self.subTest(said), self.assertRaisesRegex(ValueError, said):
                call()
        # Rows stay rows.
        given = np.arange(16.0).reshape(4, 4)
        track = sidestep.Track(1, [1.0, 2.0], [3.0, 4.0], 0.3, 1.8, 0.0, covariance=given)
        np.testing.assert_array_equal(track.covariance, given)
        np.testing.assert_array_equal(track.position_m, [1.0, 2.0])


class Depth(unittest.TestCase):
    def test_is_in_metres(self):
        depth_m = world.depth_of_pillar()
        for of, said in (("u2", "uint16: divide millimetres by 1000"), ("i4", "divide millimetres by 1000"),
                         (bool, "bool"), (complex, "complex128"), (object, "object")):
            with self.subTest(str(of)), self.assertRaisesRegex(TypeError, "depth_m.*" + said):
                world.frame(depth_m.astype(of))
        for of in ("f4", "f8", ">f4"):
            np.testing.assert_array_equal(world.frame(depth_m.astype(of)).depth_m, depth_m)

    def test_is_ahead_of_the_camera(self):
        depth_m = world.depth_of_pillar()
        with self.assertRaisesRegex(ValueError, "depth_m is below 0 everywhere"):
            world.frame(-depth_m)
        depth_m[0, 0] = -1.0  # some drivers say so where nothing came back
        world.frame(depth_m)
        world.frame(0 * depth_m)
        world.frame(np.nan * depth_m)

    def test_has_a_time(self):
        for time_s in (np.inf, -np.inf, np.nan, 1e10):
            for call in (lambda: world.frame(world.depth_of_pillar(), time_s),
                         lambda: SESSION.scene("room").field([0] * 3, [1] * 3, time_s),
                         lambda: sidestep.Track(1, [0, 0], [0, 0], 0.3, 1.8, time_s)):
                with self.subTest(time_s), self.assertRaisesRegex(ValueError, "a time in s, up to 285 years"):
                    call()


class Objects(unittest.TestCase):
    def test_are_no_classes_nor_numbers(self):
        planner = SESSION.planner(PANDA, "gp_chain")

        class Robot(sidestep.Executor):
            pass

        for call, said in (
                (lambda: planner.plan(EMPTY, REST, REST, costs=[3]),
                 "int stands where an object of a class derived from sidestep.Cost is wanted: it has no `evaluate`"),
                (lambda: planner.problem(EMPTY, REST, REST, costs=[3]), "sidestep.Cost"),
                (lambda: planner.plan(EMPTY, REST, REST, costs=[sidestep.Cost]),
                 r"the class Cost stands where an object .* sidestep.Cost is wanted: Cost\(...\)"),
                (lambda: SESSION.planner(PANDA, sidestep.Optimiser), "the class Optimiser"),
                (lambda: SESSION.planner(PANDA, 3), "int stands where .*sidestep.Optimiser.* no `solve`"),
                (lambda: SESSION.loop(PANDA, Robot, "gp_chain", REST), "the class Robot"),
                (lambda: SESSION.loop(PANDA, Robot(), "gp_chain", REST, predictor=sidestep.Predictor),
                 "the class Predictor"),
                (lambda: SESSION.loop(PANDA, Robot(), "gp_chain", REST, predictor=[1]),
                 "list stands where .*sidestep.Predictor")):
            with self.subTest(said), self.assertRaisesRegex(TypeError, said):
                call()


class Files(unittest.TestCase):
    def test_of_trajectories_have_their_folders_made(self):
        motion = sidestep.Trajectory([0.0, 1.0], [REST, REST], np.zeros((2, 7)))
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "new" / "motion.csv"
            motion.write(file, PANDA)
            self.assertTrue(file.is_file())
            with self.assertRaisesRegex(sidestep.Error, "cannot be written"):
                motion.write(file / "below_a_file.csv", PANDA)
        self.assertIn("Folders on the way", sidestep.Trajectory.write.__doc__)


if __name__ == "__main__":
    unittest.main()
