"""Frames, maps, fields, sources and scenes."""

import gc
import json
import pathlib
import tempfile
import threading
import unittest

import numpy as np
import sidestep

import world

SESSION = sidestep.Session()


def brute_force(occupied, at, resolution_m, most_m):
    """From the centres of voxels `at`, n x 3, to that of the nearest occupied voxel."""
    ends = np.argwhere(occupied)
    return np.array([min(most_m, resolution_m * np.sqrt(((ends - a) ** 2).sum(1).min()))
                     for a in at])


class Frames(unittest.TestCase):
    def test_show_their_depth_without_a_copy(self):
        given = world.depth_of_pillar()
        frame = world.frame(given, 1.5)
        self.assertEqual(frame.stamp_s, 1.5)
        np.testing.assert_array_equal(frame.depth_m, given)
        np.testing.assert_array_equal(frame.T_world_camera, world.T_WORLD_CAMERA)
        self.assertTrue(np.shares_memory(frame.depth_m, frame.depth_m))
        with self.assertRaises(ValueError):
            frame.depth_m[0, 0] = 1.0
        self.assertIsNone(frame.points_m)

    def test_outlive_their_owner_as_views(self):
        depth_m = world.frame(world.depth_of_pillar()).depth_m
        gc.collect()
        np.testing.assert_array_equal(depth_m, world.depth_of_pillar())

    def test_refuse_other_shapes_types_and_poses(self):
        depth_m = world.depth_of_pillar()
        with self.assertRaisesRegex(ValueError, "120 x 160"):
            world.frame(depth_m[:, 1:])
        with self.assertRaises(TypeError):
            world.frame([["near", "far"]])
        for wrong in (2 * np.eye(4), np.diag([1.0, 1, -1, 1]), np.full((4, 4), np.nan)):
            with self.assertRaisesRegex(ValueError, "T_world_camera"):
                sidestep.Frame(depth_m, world.CAMERA, wrong)
        with self.assertRaises(ValueError):
            sidestep.Camera(0, 120, 100.0, 100.0, 0.0, 0.0)


class Maps(unittest.TestCase):
    def setUp(self):
        self.map = SESSION.map(world.MAPPER, world.FIELD)

    def test_hold_what_the_camera_saw(self):
        self.map.integrate(world.frame(world.depth_of_pillar()))
        occupied, known = self.map.occupied(), self.map.known()
        self.assertEqual(occupied.shape, (100, 100, 40))
        self.assertEqual(self.map.grid.size_vox, [100, 100, 40])
        # The pillar's voxels are 50: x from 1.5 m on. Beyond the wall's 4.0 m the grid ends.
        self.assertEqual(set(np.argwhere(occupied)[:, 0]), {50})
        at_y_m = -2.5 + 0.05 * (np.argwhere(occupied)[:, 1] + 0.5)
        self.assertTrue((np.abs(at_y_m) < 0.15 + 0.05).all())
        self.assertTrue(known[40, 50, 20])       # between camera and pillar
        self.assertFalse(known[60, 50, 20])      # behind the pillar
        self.assertFalse((occupied & ~known).any())

    def test_give_fields_of_exact_distances(self):
        field = self.map.integrate(world.frame(world.depth_of_pillar()))
        distances_m = field.distances()
        at = np.random.default_rng(1).integers(0, (100, 100, 40), (500, 3))
        expected_m = brute_force(self.map.occupied(), at, 0.05, field.max_distance_m)
        np.testing.assert_allclose(distances_m[tuple(at.T)], expected_m, atol=1e-6)
        centres_m = field.grid.origin_m + (at + 0.5) * field.grid.resolution_m
        inside = ((at > 0) & (at < np.array([99, 99, 39]))).all(1)
        np.testing.assert_allclose(field.distance(centres_m[inside]), expected_m[inside], atol=1e-6)
        distance_m, gradient, status = field.query(centres_m[inside])
        np.testing.assert_array_equal(distance_m, field.distance(centres_m[inside]))
        self.assertEqual(gradient.shape, (inside.sum(), 3))
        known = self.map.known()[tuple(at[inside].T)]
        np.testing.assert_array_equal(status == sidestep.KNOWN, known)
        self.assertEqual(field.query([[99.0, 0, 0]])[2][0], sidestep.OUTSIDE)

    def test_leave_earlier_fields_as_they_were(self):
        near = self.map.integrate(world.frame(world.depth_of_pillar(1.525)))
        block, before = near.block(3, 3, 1), near.distances()
        copied = block.copy()
        for _ in range(20):
            far = self.map.integrate(world.frame(world.depth_of_pillar(2.525)))
        self.assertGreater(far.sequence, near.sequence)
        self.assertGreater(np.abs(far.distances() - before).max(), 0.5)
        np.testing.assert_array_equal(near.distances(), before)
        np.testing.assert_array_equal(block, copied)

    def test_refuse_what_they_cannot_use_and_stay_as_they_were(self):
        seen = SESSION.map(world.MAPPER, world.FIELD, SESSION.robot("hsr"))
        seen.integrate(world.frame(world.depth_of_pillar()))
        before = seen.occupied()
        with self.assertRaises(sidestep.Error) as caught:
            seen.integrate(sidestep.Frame(world.depth_of_pillar(2.0), world.CAMERA,
                                          world.T_WORLD_CAMERA, joint_positions=[0.0, 0.0]))
        self.assertEqual(caught.exception.code, "bad_frame")
        self.assertIn("robot 'hsr' has 8 joints", caught.exception.message)
        np.testing.assert_array_equal(seen.occupied(), before)

    def test_can_be_used_by_several_threads(self):
        failures = []

        def add():
            try:
                for _ in range(10):
                    self.map.integrate(world.frame(world.depth_of_pillar()))
                    self.map.occupied()
            except Exception as error:  # pylint: disable=broad-except
                failures.append(error)

        threads = [threading.Thread(target=add) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(failures, [])
        field = self.map.integrate(world.frame(world.depth_of_pillar()))
        self.assertEqual(field.sequence, 41)


class LargeFields(unittest.TestCase):
    def test_are_seen_block_by_block_without_a_copy(self):
        large = dict(world.MAPPER, resolution_m=0.025, size_vox=[320, 320, 128],
                     origin_m=[-2.0, -4.0, 0.0])
        field = SESSION.map(large, world.FIELD).integrate(world.frame(world.depth_of_pillar()))
        gc.collect()
        counts = field.block_counts
        self.assertEqual(counts, [20, 20, 8])
        whole = field.distances()
        self.assertEqual(whole.size, 320 * 320 * 128)
        for i, j, k in np.ndindex(*counts):
            block = field.block(i, j, k)
            self.assertFalse(block.flags.owndata)
            self.assertFalse(block.flags.writeable)
            np.testing.assert_array_equal(
                block, whole[16 * i:16 * i + 16, 16 * j:16 * j + 16, 16 * k:16 * k + 16])
        again = field.block(3, 4, 5)
        self.assertTrue(np.shares_memory(again, field.block(3, 4, 5)))
        with self.assertRaisesRegex(IndexError, "20 x 20 x 8"):
            field.block(20, 0, 0)

    def test_live_on_in_a_block(self):
        field = SESSION.map(world.MAPPER, world.FIELD).integrate(
            world.frame(world.depth_of_pillar()))
        copied = field.block(3, 3, 1).copy()
        block = field.block(3, 3, 1)
        del field
        gc.collect()
        np.testing.assert_array_equal(block, copied)
        # The last blocks are cut off where the grid ends.
        field = SESSION.map(world.MAPPER, world.FIELD).integrate(
            world.frame(world.depth_of_pillar()))
        self.assertEqual(field.block(6, 6, 2).shape, (4, 4, 8))


class Sources(unittest.TestCase):
    def test_hand_out_recorded_frames(self):
        with tempfile.TemporaryDirectory() as folder:
            images = [world.depth_of_pillar(1.0 + 0.25 * i) for i in range(3)]
            source = SESSION.source({"plugin": "depth_sequence",
                                     "path": world.write_sequence(folder, images)})
            self.assertEqual(len(source), 3)
            frames = list(source)
        self.assertEqual(len(frames), 3)
        for frame, image in zip(frames, images):
            np.testing.assert_allclose(frame.depth_m, image, atol=5e-4)
            self.assertEqual((frame.camera.fx_px, frame.camera.cy_px), (131.25, 59.5))
        self.assertEqual(source.bad_frames, [])

    def test_pass_over_what_cannot_be_read_and_say_so(self):
        with tempfile.TemporaryDirectory() as folder:
            images = [world.depth_of_pillar() for _ in range(3)]
            world.write_sequence(folder, images)
            (pathlib.Path(folder) / "frame-000001.pose.txt").write_text("no matrix\n")
            source = SESSION.source({"plugin": "depth_sequence", "path": folder})
            self.assertEqual(len(list(source)), 2)
        self.assertEqual(len(source.bad_frames), 1)
        self.assertIn("frame-000001.pose.txt", str(source.bad_frames[0]))

    def test_simulate_scenes(self):
        way = [{"time_s": 0.0, "position_m": [-1.0, 0.0, 1.0], "look_at_m": [1.0, 0.0, 1.0]}]
        ball = {"objects": [{"name": "ball", "shape": {"sphere": {"radius_m": 0.5}},
                             "pose": {"xyz_m": [1.0, 0.0, 1.0]}}]}
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "ball.yaml"
            file.write_text(json.dumps(ball))  # JSON is YAML
            frames = list(SESSION.source({"plugin": "simulator", "scene": file, "frames": 2,
                                          "camera_path": way}))
        self.assertEqual(len(frames), 2)
        camera = frames[0].camera
        at_centre_m = frames[0].depth_m[round(camera.cy_px), round(camera.cx_px)]
        self.assertAlmostEqual(float(at_centre_m), 1.5, delta=2e-3)

    def test_that_do_not_exist_are_named(self):
        with self.assertRaises(sidestep.Error) as caught:
            SESSION.source({"plugin": "depth_sequence", "path": "/no/such/folder"})
        self.assertIn("/no/such/folder", str(caught.exception))


class Scenes(unittest.TestCase):
    DOCUMENT = {"objects": [{"name": "ball", "shape": {"sphere": {"radius_m": 0.5}},
                             "pose": {"xyz_m": [1.0, 0.0, 0.0]}}]}

    def test_tell_exact_distances(self):
        scene = SESSION.scene(self.DOCUMENT)
        self.assertEqual(scene.objects, ["ball"])
        self.assertAlmostEqual(scene.signed_distance([3.0, 0, 0]), 1.5, places=12)
        self.assertAlmostEqual(scene.signed_distance([1.1, 0, 0]), -0.4, places=12)
        field = scene.field([-2] * 3, [2] * 3)
        points_m = np.random.default_rng(2).uniform(-2, 2, (100, 3))
        expected_m = np.linalg.norm(points_m - [1, 0, 0], axis=1) - 0.5
        np.testing.assert_allclose(field.distance(points_m), expected_m, atol=1e-6)
        with self.assertRaises(sidestep.Error):
            field.distances()  # it has no voxels

    def test_of_the_installation_are_found_by_name(self):
        self.assertIn("table_top", SESSION.scene("room").objects)
        with self.assertRaises(sidestep.Error) as caught:
            SESSION.scene("roon")
        self.assertEqual(caught.exception.code, "not_found")
        self.assertIn("room", caught.exception.hint)

    def test_name_the_key_that_is_wrong(self):
        wrong = {"objects": [{"name": "ball", "shape": {"sphere": {"radius_m": -1}}}]}
        with self.assertRaisesRegex(sidestep.Error, r"objects\[0\].*radius_m"):
            SESSION.scene(wrong)


if __name__ == "__main__":
    unittest.main()
