"""Maps, distance fields, robots and whole-body motion planning."""

from ._core import (
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
    Grid,
    Joint,
    Loop,
    Map,
    Plan,
    Planner,
    Problem,
    Robot,
    Scene,
    Session,
    SetProblem,
    Source,
    Trajectory,
    Verdict,
    certify,
    field_check,
    read_problem_set,
    shape_check,
)


class Cost:
    """A cost of one state, for Planner.plan(costs=...). The cost is half the sum of squares."""

    name = "cost"
    residual_count = 1
    depends_on_velocity = False

    def evaluate(self, q, qdot, times_s):
        """Of n states of d joints (n x d, n x d, n): the residuals, n x residual_count, their
        derivatives by q, n x residual_count x d, and, where they depend on velocity, by qdot."""
        raise NotImplementedError


class Optimiser:
    """A planner in Python, for Session.planner(optimiser=...)."""

    def solve(self, problem, initial, deadline_s):
        """A Trajectory from problem.start to problem.goal, or None; within deadline_s seconds."""
        raise NotImplementedError


class Executor:
    """A robot, real or simulated, for Session.loop(). Times are those of Loop.step()."""

    def current(self):
        """The newest measured state: positions and velocities, one for each joint, and its time in s."""
        raise NotImplementedError

    def follow(self, trajectory, start_s):
        """From now on the robot follows a trajectory whose time 0 is at start_s, in place of what it
        follows, at once where that has passed."""
        raise NotImplementedError

    def stop(self):
        """Brings the robot to rest."""
        raise NotImplementedError
