"""The type stubs say what the module has, and what the documentation shows works."""

import ast
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
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

    def test_are_exported_with_a_docstring_each(self):
        for name in self.STUBS:
            self.assertIs(getattr(sidestep, name), getattr(_core, name))
            if isinstance(getattr(_core, name), type):
                self.assertTrue(getattr(_core, name).__doc__, name)


class Module(unittest.TestCase):
    @unittest.skipUnless(os.environ.get("OTHER_VERSION"), "the library of another version is not built")
    def test_refuses_a_library_of_another_version(self):
        said = subprocess.run([sys.executable, "-c", "import sidestep"], capture_output=True, text=True,
                              env={**os.environ, "LD_PRELOAD": os.environ["OTHER_VERSION"]},
                              timeout=120, check=False)
        self.assertRegex(said.stderr, r"ImportError: the module sidestep is of version "
                                      + re.escape(sidestep.__version__)
                                      + r", the library that it has loaded of 9\.8\.7")


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
