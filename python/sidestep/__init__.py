"""Maps, distance fields, robots and whole-body motion planning."""

import importlib.util
import os
import struct
from typing import Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _refuse_cut_off_library() -> None:
    """To load a library that was not copied whole ends the interpreter without a word."""
    spec = importlib.util.find_spec("._core", __name__)
    if spec is None or spec.origin is None:
        return
    file = spec.origin
    with open(file, "rb") as library:
        head = library.read(64)
    if len(head) < 64 or head[:6] != b"\x7fELF\x02\x01":
        return  # no ELF of 64 bits, little-endian: for the loader to judge
    # The table of sections, which comes last.
    offset, = struct.unpack_from("<Q", head, 40)
    entry_size, entries = struct.unpack_from("<HH", head, 58)
    whole, size = offset + entry_size * entries, os.path.getsize(file)
    if size < whole:
        raise ImportError(f"{file} has {size} of {whole} bytes: install it again", path=file)


_refuse_cut_off_library()
from ._core import (  # noqa: E402
    KNOWN,
    OUTSIDE,
    UNKNOWN,
    Camera,
    Certification,
    Check,
    DistanceField,
    Error,
    Event,
    Frame,
    GazeRequest,
    Grid,
    Joint,
    Loop,
    Map,
    Plan,
    Planner,
    PredictedSet,
    PredictionRequest,
    Problem,
    Robot,
    Scene,
    Session,
    SetProblem,
    Snapshot,
    Source,
    Track,
    Trajectory,
    Verdict,
    __version__,
    certify,
    field_check,
    read_problem_set,
    shape_check,
)


class Cost:
    """A cost of one state, for Planner.plan(costs=...). The cost is half the sum of squares."""

    name: str = "cost"
    residual_count: int = 1
    depends_on_velocity: bool = False

    def evaluate(self, q: NDArray[np.float64], qdot: NDArray[np.float64],
                 times_s: NDArray[np.float64]) -> tuple[ArrayLike, ...]:
        """Of n states of d joints (n x d, n x d, n): the residuals, n x residual_count, their
        derivatives by q, n x residual_count x d, and, where they depend on velocity, by qdot."""
        raise NotImplementedError


class Optimiser:
    """A planner in Python, for Session.planner(optimiser=...)."""

    def solve(self, problem: Problem, initial: Trajectory,
              deadline_s: float) -> Optional[Trajectory]:
        """A Trajectory from problem.start to problem.goal, or None; within deadline_s seconds."""
        raise NotImplementedError


class Predictor:
    """Says where tracked things may be, for Session.loop(predictor=...)."""

    # Of whom the sets are: of the "tracks"; of "things", tracked or not; of "nothing": there are none.
    subject: str = "tracks"

    def predict(self, request: PredictionRequest) -> list[PredictedSet]:
        """A list of PredictedSet: for each track of a PredictionRequest one, or alternatives, each
        from time 0 to the horizon. Asked once for each new map."""
        raise NotImplementedError


class Gaze:
    """Turns the head of a robot, for Session.loop(gaze=...)."""

    wants_tracks: bool = False

    def look(self, request: GazeRequest) -> tuple[float, float]:
        """Where the head is to turn, pan and tilt in rad, by a GazeRequest. Asked ten times a second."""
        raise NotImplementedError


class Executor:
    """A robot, real or simulated, for Session.loop(). Times are those of Loop.step().

    One whose head a gaze turns also has head(), which returns where that is, pan and tilt in rad,
    and turn_head(pan_rad, tilt_rad), which has it turn there as fast as it can and returns at once."""

    def current(self) -> tuple[ArrayLike, ArrayLike, float]:
        """The newest measured state: positions and velocities, one for each joint, and its time in s."""
        raise NotImplementedError

    def follow(self, trajectory: Trajectory, start_s: float) -> None:
        """From now on the robot follows a trajectory whose time 0 is at start_s, in place of what it
        follows, at once where that has passed."""
        raise NotImplementedError

    def stop(self) -> None:
        """Brings the robot to rest. With wall_clock=True it may be called in another thread."""
        raise NotImplementedError
