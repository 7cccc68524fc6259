"""What is run while faults are injected: small configurations, and what they leave undisturbed."""

import pathlib
import re
import shutil
import struct
import subprocess

from runs import Outcome, run

HERE = pathlib.Path(__file__).resolve().parent
CASES = HERE.parent / "net" / "cases"
KINDS = ["alloc", "large", "open", "read", "write", "sync", "rename", "map", "thread", "socket", "clock", "fork"]


class Scenario:
    """A command line with {out} for the folder it writes to, and {given} for a copy of what `before` left."""

    def __init__(self, name, words, before=None, codes=(0, 1, 2, 3, 4), level=1, exact=True, record=False, view=False,
                 kinds=KINDS[:-1], share=1.0):
        self.name, self.words, self.before, self.codes, self.level = name, words, before, codes, level
        self.exact, self.record, self.view, self.kinds, self.share = exact, record, view, kinds, share


PLAN = ["run", CASES / "plan.yaml", "--set", "experiment.slice_heights_m=[0.3]", "--set",
        "experiment.plans=[{name: there, start: {joints: {x: 0.3, y: 0.05}}, goal: {joints: {x: 2.7, y: -0.1}}}]"]
STUDY = ["run", CASES / "field_study.yaml", "--set", "experiment.scenes=2"]
LONG_STUDY = ["run", CASES / "field_study.yaml", "--set", "experiment.scenes=100"]
RACE = ["run", CASES / "planner_benchmark.yaml", "--set", "experiment.seeds=2"]
REPLAN = ["run", CASES / "replan.yaml", "--set", "experiment.pictures=1"]
SHORT = ["--set", "experiment.episodes=1", "--set", "experiment.goal.joints.x=0.8", "--set", "experiment.random=null"]
WALL = ["--set", "experiment.clock=wall", "--set", "experiment.goal.joints.x=0.3"]

SCENARIOS = [
    Scenario("plan", PLAN + ["--out", "{out}"], share=3),
    Scenario("plan_threads", PLAN + ["--threads", "3", "--out", "{out}"], exact=False),
    Scenario("ceres", PLAN + ["--set", "optimiser.plugin=gp_ceres", "--out", "{out}"]),
    Scenario("replan", REPLAN + SHORT + ["--out", "{out}"], share=2),
    Scenario("live", REPLAN + SHORT + WALL + ["--out", "{out}"], exact=False),
    Scenario("deploy", ["run", CASES / "deploy.yaml", "--set", "experiment.goals=1", "--out", "{out}"]),
    Scenario("field_study", STUDY + ["--out", "{out}"]),
    Scenario("planner_benchmark", RACE + ["--out", "{out}"], share=2),
    Scenario("resume", RACE + ["--resume", "{given}"],
             before=[["run", CASES / "planner_benchmark.yaml", "--set", "experiment.seeds=2", "--out", "{given}"]]),
    Scenario("resume_replan", REPLAN + SHORT + ["--set", "experiment.episodes=2", "--resume", "{given}"],
             before=[REPLAN + SHORT + ["--out", "{given}"]]),
    Scenario("jobs", STUDY + ["--jobs", "2", "--out", "{out}"]),
    Scenario("report", ["report", "{given}"], before=[PLAN + ["--out", "{given}"]]),
    Scenario("merge", ["report", "{given}/1", "{given}/2", "--merged", "{out}"],
             before=[STUDY + ["--shard", "1/2", "--out", "{given}/1"], STUDY + ["--shard", "2/2", "--out", "{given}/2"]]),
    Scenario("record", REPLAN + SHORT + ["--out", "{out}", "--record", "{out}/run.bag"], record=True),
    Scenario("view", REPLAN + SHORT + ["--out", "{out}", "--view"], view=True, share=2),
    Scenario("view_live", REPLAN + SHORT + WALL + ["--out", "{out}", "--view", "--record", "{out}/run.bag"],
             exact=False, record=True, view=True),
    Scenario("supervisor", PLAN + ["--out", "{out}"], level=0, kinds=KINDS),
]
RESUMABLE = [
    Scenario("field_study", LONG_STUDY + ["--out", "{out}"]),
    Scenario("planner_benchmark", ["run", CASES / "planner_benchmark.yaml", "--set", "experiment.seeds=3", "--out", "{out}"]),
    Scenario("replan", REPLAN + SHORT + ["--set", "experiment.episodes=3", "--out", "{out}"]),
]


class Bench:
    """A scenario, ready to be disturbed: what it leaves undisturbed, and how many calls it makes."""

    def __init__(self, scenario, options):
        self.scenario, self.options = scenario, options
        self.folder = options.work / ("of_" + scenario.name)
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        self.given = self.folder / "given"
        for words in scenario.before or []:
            done = self.command(words, self.folder / "unused", self.given, {})
            if done.code != 0:
                raise SystemExit(f"{scenario.name}: preparing ends with {done.code}: {done.err}")
        counts = self.folder / "counts"
        ended = self.disturb(self.folder / "undisturbed", {"FAIL_CALLS": "", "FAIL_COUNTS": counts})
        if ended.code != 0:
            raise SystemExit(f"{scenario.name}: undisturbed, it ends with {ended.code}: {ended.err}")
        self.took_s, self.warnings = ended.took_s, ended.err.count("warning: ")
        self.counts = dict(zip(KINDS, read_counts(counts)[1:]))
        self.reference = Outcome(self.results(self.folder / "undisturbed"), self.folder / "scratch")
        self.limit_s = 120 + 40 * ended.took_s  # the machine may be busy

    def results(self, place):
        return place / ("given" if "{given}" in map(str, self.scenario.words) else "out")

    def command(self, words, out, given, environment, limit_s=300.0):
        filled = [str(word).replace("{out}", str(out)).replace("{given}", str(given)) for word in words]
        return run([self.options.sidestep, *filled], environment, limit_s, view=self.scenario.view)

    def disturb(self, place, environment, again=False):
        """Runs it in the folder `place`, a new one unless `again`."""
        if not again:
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir(parents=True)
            if self.given.exists():
                shutil.copytree(self.given, place / "given")
        if self.scenario.record:
            (place / "out").mkdir(exist_ok=True)
            (place / "out" / "run.bag").unlink(missing_ok=True)
        if environment:
            environment = {"LD_PRELOAD": self.options.shim, "FAIL_LEVEL": self.scenario.level,
                           "FAIL_SPARES": self.options.spares,
                           **environment}
            environment = {key: str(value) for key, value in environment.items()}
        return self.command(self.scenario.words, place / "out", place / "given", environment,
                            getattr(self, "limit_s", 300.0))


def fragile_function(program):
    """Offset and size of CLI11's get_option_no_throw(), which is noexcept and allocates; empty where nm does not know."""
    try:
        symbols = subprocess.run(["nm", "-S", "--defined-only", program], capture_output=True, text=True).stdout
    except OSError:
        return ""
    found = re.search(r"^(\w+) (\w+) \w _ZN3CLI3App19get_option_no_throw", symbols, re.M)
    return f"{found[1]} {found[2]}" if found else ""


def read_counts(file):
    data = file.read_bytes() if file.exists() else b""
    return struct.unpack(f"<{len(data) // 8}Q", data) if data else (0,) * (len(KINDS) + 2)
