"""What the module says of itself: stubs, docstrings, types, version; and that the documentation shows what works."""

import ast
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import types
import unittest

import numpy as np
import sidestep
from sidestep import _core, results

import world

ROOT = pathlib.Path(__file__).resolve().parents[2]


def members(body):
    """Name, and arguments with their defaults or None where it is not called, of each entry."""
    found = {}
    for item in body:
        if isinstance(item, ast.FunctionDef):
            names = [a.arg for a in item.args.args]
            defaults = [None] * (len(names) - len(item.args.defaults)) + [
                ast.unparse(d) for d in item.args.defaults]
            is_property = any(getattr(d, "id", "") == "property" for d in item.decorator_list)
            found[item.name] = None if is_property else list(zip(names, defaults))
        elif isinstance(item, ast.ClassDef):
            found[item.name] = members(item.body)
        elif isinstance(item, ast.AnnAssign):
            found[item.target.id] = None
    return found


def arguments_of(function):
    """As its first line says, which pybind11 writes."""
    line = function.__doc__.split("\n")[0]
    tree = ast.parse("def " + re.sub(r"<[^>]*>", "x", line) + ": ...")
    return members(tree.body)[tree.body[0].name]


class Stubs(unittest.TestCase):
    STUBS = members(ast.parse((ROOT / "python/sidestep/_core.pyi").read_text()).body)

    def same_arguments(self, said, function, name):
        is_special = name.startswith("__") and name != "__init__"
        if is_special:
            return
        self.assertEqual([(n, d) for n, d in said if n != "self"],
                         [(n, d) for n, d in arguments_of(function) if n != "self"], name)

    def test_say_what_the_module_has(self):
        public = {name for name in vars(_core) if not name.startswith("_")}
        self.assertEqual(public | {"__version__"}, set(self.STUBS))
        for name, said in self.STUBS.items():
            thing = getattr(_core, name)
            if name == "Error" or said is None:
                continue
            if isinstance(said, list):
                self.same_arguments(said, thing, name)
                continue
            own = {n for n in vars(thing) if not n.startswith("_") or n in (
                "__len__", "__iter__", "__next__", "__bool__", "__str__")}
            if "def __init__" in (thing.__init__.__doc__ or "") or "__init__(" in (
                    thing.__init__.__doc__ or ""):
                own.add("__init__")
            self.assertEqual(own, set(said), name)
            for member, arguments in said.items():
                if arguments is not None:
                    self.same_arguments(arguments, getattr(thing, member), f"{name}.{member}")

    def test_are_exported(self):
        for name in self.STUBS:
            self.assertIs(getattr(sidestep, name), getattr(_core, name))


def public_things(module):
    """Name and thing of each class and function of a module, and of what each class has."""
    for name, thing in vars(module).items():
        if name.startswith("_") or not str(getattr(thing, "__module__", "")).startswith("sidestep"):
            continue
        yield name, thing
        for member, what in vars(thing).items() if isinstance(thing, type) else ():
            if not member.startswith("_") and (callable(what) or isinstance(what, property)):
                yield f"{name}.{member}", what


class Docstrings(unittest.TestCase):
    THINGS = dict([*public_things(_core), *public_things(sidestep), *public_things(results)])

    def test_has_each_class_function_and_property(self):
        self.assertGreater(len(self.THINGS), 150)
        for name, thing in self.THINGS.items():
            # Of a function in C++ the signature comes first, and says nothing.
            said = re.sub(r"\A\w+\(.*\) -> .*", "", thing.__doc__ or "")
            with self.subTest(name):
                self.assertRegex(said.strip(), r"\w{2}")

    def test_name_units(self):
        """Where a name says no unit, and the thing has one."""
        for name, unit in (("Joint.lower", "unit"), ("Joint.upper", "unit"), ("Joint.max_velocity", "per second"),
                           ("Frame.T_world_camera", "optical frame"), ("Trajectory.velocities", "rad/s"),
                           ("Problem.start", "rad"), ("GazeRequest.qdot", "rad/s"), ("PredictedSet.knots", "in m"),
                           ("DistanceField.block", "in m"), ("Track.covariance", "m/s")):
            self.assertIn(unit, self.THINGS[name].__doc__, name)


class Types(unittest.TestCase):
    def test_are_said_of_what_is_written_in_python(self):
        functions = {name: getattr(thing, "fget", thing) for name, thing in Docstrings.THINGS.items()
                     if isinstance(getattr(thing, "fget", thing), types.FunctionType)}
        self.assertEqual({"Cost.evaluate", "Executor.follow", "Run.table", "plot"} - set(functions), set())
        for name, function in functions.items():
            code = function.__code__
            names = set(code.co_varnames[:code.co_argcount]) - {"self"} | {"return"}
            self.assertEqual(set(function.__annotations__), names, name)


class Calls(unittest.TestCase):
    def test_that_do_next_to_nothing_take_at_most_5_us(self):
        session = sidestep.Session()
        panda = session.robot("panda")
        field = session.scene({"objects": []}).field([-2] * 3, [2] * 3)
        point_m, q = np.zeros((1, 3)), panda.configuration("ready")
        for name, call in (("robot.dof", lambda: panda.dof), ("field.distance", lambda: field.distance(point_m)),
                           ("robot.link_poses", lambda: panda.link_poses(q))):
            best_s = np.inf
            for _ in range(100):  # of the thread alone, and the best of many: whoever else is busy
                begun_s = time.thread_time()
                for _ in range(200):
                    call()
                best_s = min(best_s, (time.thread_time() - begun_s) / 200)
            self.assertLess(1e6 * best_s, 5.0, name)


class Module(unittest.TestCase):
    @unittest.skipUnless(os.environ.get("OTHER_VERSION"), "the library of another version is not built")
    def test_refuses_a_library_of_another_version(self):
        said = subprocess.run([sys.executable, "-c", "import sidestep"], capture_output=True, text=True,
                              env={**os.environ, "LD_PRELOAD": os.environ["OTHER_VERSION"]},
                              timeout=120, check=False)
        self.assertRegex(said.stderr, r"ImportError: the module sidestep is of version "
                                      + re.escape(sidestep.__version__)
                                      + r", the library that it has loaded of 9\.8\.7")


    def test_refuses_a_library_that_was_not_copied_whole(self):
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(shutil.copytree(pathlib.Path(sidestep.__file__).parent,
                                                pathlib.Path(folder) / "sidestep"))
            library = copy / pathlib.Path(_core.__file__).name
            whole = library.stat().st_size
            for size in (whole, whole - 1, 50000):
                with open(library, "r+b") as file:
                    file.truncate(size)
                said = subprocess.run([sys.executable, "-c", "import sidestep"], capture_output=True, text=True,
                                      env={**os.environ, "PYTHONPATH": folder}, timeout=120, check=False)
                if size == whole:
                    self.assertEqual((said.returncode, said.stderr), (0, ""))
                    continue
                self.assertEqual(said.returncode, 1, said.stderr)
                self.assertEqual(said.stderr.splitlines()[-1],
                                 f"ImportError: {library} has {size} of {whole} bytes: install it again")


class Pages(unittest.TestCase):
    def test_the_example_plans_from_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            world.write_sequence(folder, [world.depth_of_pillar()] * 3)
            motion = pathlib.Path(folder) / "motion.csv"
            said = subprocess.run([sys.executable, ROOT / "docs/examples/plan.py", folder, motion],
                                  capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual(said.returncode, 0, said.stderr)
            self.assertRegex(said.stdout, r"^[0-9.]+ s long, found in \d+ ms, proven\n$")
            self.assertTrue(motion.read_text().startswith("time_s,odom_x,"))

    def test_the_reference_runs(self):
        page = (ROOT / "docs/reference/python.md").read_text()
        blocks = re.findall(r"```python\n(.*?)```", page, re.S)
        self.assertGreater(len(blocks), 3)
        names = {}
        with tempfile.TemporaryDirectory() as folder:
            world.write_sequence(folder, [world.depth_of_pillar()] * 3)
            for block in blocks:
                code = block.replace('"recorded"', repr(folder)).replace(
                    '"motion.', f'"{folder}/motion.')
                exec(compile(code, "docs/reference/python.md", "exec"), names)  # pylint: disable=exec-used

    def test_the_notebook_runs(self):
        notebook = json.loads((ROOT / "docs/examples/results.ipynb").read_text())
        names, values = {}, []
        for cell in notebook["cells"]:
            if cell["cell_type"] != "code":
                continue
            self.assertEqual(cell["outputs"], [])
            body = ast.parse("".join(cell["source"])).body
            # As in a notebook, a cell's value is that of its last line.
            exec(compile(ast.Module(body[:-1], []), "results.ipynb", "exec"), names)
            values.append(eval(compile(ast.Expression(body[-1].value), "results.ipynb", "eval"),
                               names))
        self.addCleanup(shutil.rmtree, names["folder"])
        runs, numbers, frames, _, outcome = values
        for run in runs:
            self.assertTrue(run.summary["verdict"].startswith("Success"), run.summary["verdict"])
        self.assertEqual(list(numbers.index), ["gp_chain", "gp_ceres"])
        self.assertEqual(numbers["map.occupied_vox"].nunique(), 1)
        self.assertEqual(frames.loc["count", "field_ms"], runs[0].summary["frames"])
        self.assertEqual(outcome, "proven")
        self.assertIn("<svg", (names["folder"] / "frames.svg").read_text())
        motion = names["motion"]
        recorded = runs[0].table("trajectory/0")
        np.testing.assert_array_equal(motion.times_s, recorded["time_s"])
        self.assertEqual(len(motion), len(recorded))
        self.assertEqual(runs[0].array("depth", 0, "depth_m").shape, (240, 320))
        with self.assertRaisesRegex(KeyError, "no series 'frames': there are .*frame"):
            runs[0].table("frames")
        with self.assertRaises(KeyError):
            runs[0].array("depth", 99, "depth_m")

    def test_what_is_no_run_is_said(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(FileNotFoundError, "no run in this folder"):
                results.Run(folder)
            file = pathlib.Path(folder) / "results.sqlite"
            file.write_text("not a database, though it is long enough to be one" * 20)
            with self.assertRaisesRegex(ValueError, "results.sqlite.*not a database"):
                results.Run(folder).table("frame")


if __name__ == "__main__":
    unittest.main()
