"""Callbacks that hang, and an interpreter that ends while others are at work."""

import inspect
import logging
import subprocess
import sys
import textwrap
import threading
import unittest

import numpy as np
import sidestep

SESSION = sidestep.Session()
PANDA = SESSION.robot("panda")
START = np.array([-0.8, 0.4, 0.0, -1.9, 0.0, 2.3, 0.785])
EMPTY = SESSION.scene({"objects": []}).field([-2] * 3, [2] * 3)

HEAD = """
import sys, threading, time
import numpy as np
import sidestep

class Wrist(sidestep.Cost):
    def evaluate(self, q, qdot, times_s):
        derivatives = np.zeros((len(q), 1, 7))
        derivatives[:, 0, 6] = 1
        return q[:, 6:] - 1.0, derivatives

class Slow(sidestep.Optimiser):
    def solve(self, problem, initial, deadline_s):
        time.sleep(0.3)

session = sidestep.Session()
panda = session.robot("panda")
box = {"objects": [{"name": "box", "shape": {"box": {"size_m": [0.2, 0.2, 0.6]}},
                    "pose": {"xyz_m": [0.5, 0.0, 0.3]}}]}
field = session.scene(box).field([-2] * 3, [2] * 3)
start = np.array([-0.8, 0.4, 0.0, -1.9, 0.0, 2.3, 0.785])
inside = np.array([0.0, 0.6, 0.0, -1.6, 0.0, 2.2, 0.785])
begun = threading.Event()
"""


class Leaving(unittest.TestCase):
    def leave(self, work):
        """Ends the interpreter half a second after a daemon thread has begun to repeat `work`."""
        code = HEAD + textwrap.dedent(f"""
            def run():
                {work[0]}
                begun.set()
                while True:
                    {work[1]}
            threading.Thread(target=run, daemon=True).start()
            begun.wait()
            time.sleep(0.5)
            sys.exit(7)
            """)
        return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                              timeout=120, check=False)

    def test_while_a_daemon_thread_works_is_quiet(self):
        plan = "planner.plan(field, start, inside, deadline_s=2.0"
        made = "planner = session.planner(panda, {}, sampler='rrt_connect', planning={{'unknown': 'free'}})"
        for work in ((made.format("'gp_chain'"), plan + ")"),
                     (made.format("'gp_chain'"), plan + ", costs=[Wrist()])"),
                     (made.format("Slow()"), plan + ")"),
                     ("points_m = np.zeros((100000, 3))", "field.distance(points_m)"),
                     ("", "session.scene('room')")):
            with self.subTest(work):
                said = self.leave(work)
                self.assertEqual((said.returncode, said.stderr), (7, ""))


class Hanging(unittest.TestCase):
    def test_callbacks_are_named(self):
        done = threading.Event()

        class Stuck(sidestep.Cost):
            def evaluate(self, q, qdot, times_s):
                done.wait(60.0)  # here
                return np.zeros((len(q), 1)), np.zeros((len(q), 1, 7))

        class Lost(sidestep.Optimiser):
            def solve(self, problem, initial, deadline_s):
                self.look()

            def look(self):
                done.wait(60.0)  # there

        class Until(logging.Handler):
            """Has the callback go on when it is warned of."""

            def emit(self, record):
                warnings.append(record.getMessage())
                done.set()

        lines, first = inspect.getsourcelines(type(self).test_callbacks_are_named)
        handler = Until()
        logging.getLogger("sidestep").addHandler(handler)
        self.addCleanup(logging.getLogger("sidestep").removeHandler, handler)
        for planner, costs, said, where in (
                (SESSION.planner(PANDA, "gp_chain"), [Stuck()], "Stuck.evaluate()", ("evaluate", "# here")),
                (SESSION.planner(PANDA, Lost()), [], "Lost.solve()", ("look", "# there"))):
            warnings = []
            done.clear()
            planner.plan(EMPTY, START, START + 0.01, deadline_s=0.2, costs=costs)
            line = first + next(i for i, text in enumerate(lines) if text.endswith(where[1] + "\n"))
            self.assertEqual(len(warnings), 1, warnings)
            self.assertEqual(warnings[0], f"planning is past its deadline, and still in {said}: "
                                          f"{__file__}:{line}, in {where[0]}")

    def test_is_not_said_of_who_keeps_time(self):
        class Quick(sidestep.Optimiser):
            def solve(self, problem, initial, deadline_s):
                return None

        with self.assertNoLogs("sidestep"):
            SESSION.planner(PANDA, Quick()).plan(EMPTY, START, START + 0.01, deadline_s=0.1)
        for deadline_s in (float("inf"), -1.0):
            SESSION.planner(PANDA, Quick()).plan(EMPTY, START, START + 0.01, deadline_s=deadline_s)


if __name__ == "__main__":
    unittest.main()
