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


class Predictor:
    """Says where tracked things may be, for Session.loop(predictor=...)."""

    # Of whom the sets are: of the "tracks"; of "things", tracked or not; of "nothing": there are none.
    subject = "tracks"

    def predict(self, request):
        """A list of PredictedSet: for each track of a PredictionRequest one, or alternatives, each
        from time 0 to the horizon. Asked once for each new map."""
        raise NotImplementedError


class Gaze:
    """Turns the head of a robot, for Session.loop(gaze=...)."""

    wants_tracks = False

    def look(self, request):
        """Where the head is to turn, pan and tilt in rad, by a GazeRequest. Asked ten times a second."""
        raise NotImplementedError


class Executor:
    """A robot, real or simulated, for Session.loop(). Times are those of Loop.step().

    One whose head a gaze turns also has head(), which returns where that is, pan and tilt in rad,
    and turn_head(pan_rad, tilt_rad), which has it turn there as fast as it can and returns at once."""

    def current(self):
        """The newest measured state: positions and velocities, one for each joint, and its time in s."""
        raise NotImplementedError

    def follow(self, trajectory, start_s):
        """From now on the robot follows a trajectory whose time 0 is at start_s, in place of what it
        follows, at once where that has passed."""
        raise NotImplementedError

    def stop(self):
        """Brings the robot to rest. With wall_clock=True it may be called in another thread."""
        raise NotImplementedError
