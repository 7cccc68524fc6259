"""Runs of the command without what a machine usually has."""

import concurrent.futures
import os
import re
import resource
import shutil
import sqlite3
import time

from runs import CRASH, Outcome, incomplete, run
from scenarios import PLAN, RACE, REPLAN, SCENARIOS, SHORT, WALL, Bench


class Skipped(Exception):
    """Why something cannot be tried here."""


class Surroundings:
    """Runs without what a machine usually has. A method each; what it yields does not hold."""

    def __init__(self, options):
        self.options, self.runs = options, 0
        self.folder = options.work / "surroundings"
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        self.plan = [str(word) for word in PLAN]
        self.replan = [str(word) for word in REPLAN + SHORT]
        self.bench = Bench(SCENARIOS[0], options)

    def new(self, name):
        place = self.folder / name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        return place

    def run(self, words, **how):
        self.runs += 1
        return run([self.options.sidestep, *words], limit_s=300, **how)

    def wrong(self, ended, what, codes=(0, 1, 2, 3, 4), needs=""):
        """What does not hold of an end; empty where all does."""
        if ended.timed_out:
            return f"{what}: hangs"
        if ended.code < 0 or CRASH.search(ended.err):
            return f"{what}: exit code {ended.code}: {ended.message()}"
        if ended.code not in codes:
            return f"{what}: exit code {ended.code}: {ended.message()}"
        if ended.code != 0 and needs not in ended.err:
            return f"{what}: '{needs}' is not told: {ended.message()}"
        if ended.code >= 2 and not ended.message():
            return f"{what}: exit code {ended.code} without a message"
        return ""

    def left(self, out, what):
        """What does not hold of a success in `out`."""
        try:
            finding = incomplete(Outcome(out, self.folder / "scratch"), self.bench.reference, True)
        except (ValueError, sqlite3.DatabaseError) as error:
            finding = f"damaged: {error}"
        return f"{what}: {finding}" if finding else ""

    def full_output(self):
        """What is printed goes to a full disk."""
        if not os.path.exists("/dev/full"):
            raise Skipped("there is no /dev/full")
        out = self.new("full_output") / "out"
        for words in ([*self.plan, "--out", out, "--json"], [*self.plan, "--out", out], ["report", out], ["plugins"],
                      ["check", *self.plan[1:2]], ["plugins", "--json"], ["--help"], ["--version"], ["robot", "planar"]):
            with open("/dev/full", "w") as full:
                yield self.wrong(self.run(words, stdout=full), f"{words[0]} > /dev/full", (4,), "No space left on device")

    def closed_streams(self):
        """Some of the standard streams are closed: a file of the run may have their numbers."""
        for closed in ("<&-", ">&-", "2>&-", "<&- >&-", "<&- 2>&-", ">&- 2>&-", "<&- >&- 2>&-"):
            place = self.new("closed_streams")
            out, bag = place / "out", place / "run.bag"
            shell = ["sh", "-c", f'exec "$@" {closed}', "sh"]
            yield self.wrong(self.run([*self.plan, "--out", out, "--record", bag], shell_prefix=shell), closed, (0,))
            yield self.left(out, closed)
            if not bag.exists() or not bag.read_bytes().startswith(b"#ROSBAG V2.0\n"):
                yield f"{closed}: the recording is damaged"
            log = out / "run.log"
            strange = [line for line in log.read_text().splitlines() if not re.match(r"\d{4}-\d\d-\d\d ", line)]
            if strange:
                yield f"{closed}: in run.log: {strange[0][:100]}"

    def in_namespace(self, script, *words):
        if shutil.which("unshare") is None or run(["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"]).code != 0:
            raise Skipped("no file system can be mounted here (needs root)")
        self.runs += 1
        return run(["unshare", "-m", "sh", "-c", script, "sh", *words], limit_s=300)

    def full_disk(self):
        """The disk is full sooner or later; once there is room, the same command succeeds."""
        script = """mount -t tmpfs -o "size=$1" none "$2" || exit 99
            disk=$2 after=$3 && shift 3
            "$@"; echo $? >"$after/code"; cp -r "$disk" "$after/full"
            mount -o remount,size=64m "$disk"; rm -f "$disk"/*.bag; "$@" 2>"$after/stderr"; code=$?
            cp -r "$disk" "$after/roomy"; exit $code"""
        for size in [*range(4, 64, 8), *range(64, 800, 24)][::self.options.every]:
            place = self.new("full_disk")
            (place / "disk").mkdir()
            ended = self.in_namespace(script, f"{size}k", str(place / "disk"), str(place), self.options.sidestep,
                                      *self.plan, "--out", str(place / "disk"), "--record", str(place / "disk" / "run.bag"))
            what = f"{size} KiB of disk"
            code = int((place / "code").read_text())
            if ended.code != 0:
                yield f"{what}: with room again, exit code {ended.code}: {(place / 'stderr').read_text()[-300:]}"
                continue
            ended.code = code
            yield self.wrong(ended, what, (0, 4))
            if code == 0:
                yield self.left_but_bag(place / "full", what)
            yield self.left_but_bag(place / "roomy", what + ", then more")

    def left_but_bag(self, out, what):
        (out / "run.bag").unlink(missing_ok=True)
        return self.left(out, what)

    def read_only(self):
        """The folder, or the results in it, cannot be written."""
        script = """mount --bind "$1" "$1" && mount -o remount,ro,bind "$1" || exit 99
            shift && "$@" """
        place = self.new("read_only")
        made = self.run([*self.plan, "--out", place / "made"])
        yield self.wrong(made, "before", (0,))
        for words in ([*self.plan, "--out", place / "new"], [*self.plan, "--out", place / "made"], ["report", place / "made"],
                      [*self.plan, "--out", place / "made", "--record", place / "run.bag"]):
            ended = self.in_namespace(script, str(place), self.options.sidestep, *map(str, words))
            yield self.wrong(ended, " ".join(map(str, words[:1])) + " in a read-only folder", (4,), "ead-only file system")
        yield self.left(place / "made", "after")

    def limited(self, limit, values, codes=(0, 1, 2, 3, 4, 127), words=None):
        for value in list(values)[::self.options.every]:
            place = self.new("limited")

            def set_limit():
                resource.setrlimit(limit, (value, value))

            what = f"{limit} of {value}"
            ended = self.run([*(words or self.plan), "--out", place / "out"], limits=set_limit)
            if ended.code == 127 and "loading shared libraries" not in ended.err:
                yield f"{what}: exit code 127: {ended.message()}"
            yield self.wrong(ended, what, codes)
            if ended.code == 0 and not words:
                yield self.left(place / "out", what)

    def few_handles(self):
        yield from self.limited(resource.RLIMIT_NOFILE, range(4, 40, 1))
        yield from self.limited(resource.RLIMIT_NOFILE, range(4, 60, 5), words=[*self.replan, "--view"])

    def little_memory(self):
        yield from self.limited(resource.RLIMIT_AS, range(40 << 20, 700 << 20, 12 << 20))
        yield from self.limited(resource.RLIMIT_AS, range(60 << 20, 900 << 20, 60 << 20), words=self.replan)
        yield from self.limited(resource.RLIMIT_STACK, [1 << 18, 1 << 20])

    def small_files(self):
        yield from self.limited(resource.RLIMIT_FSIZE, [0, 1, 100, 1000, *range(4096, 400_000, 24_576)])

    def few_threads(self):
        """Root may start as many as it likes: as nobody, where that one may read the build."""
        user = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
        if os.geteuid() != 0 or shutil.which("setpriv") is None:
            raise Skipped("needs root and setpriv")
        if run([*user, self.options.sidestep, "--version"]).code != 0:
            raise Skipped("nobody may not read the build")
        place = self.new("few_threads")
        for folder in (place, self.folder, self.options.work):
            folder.chmod(0o777)
        for words in (self.plan, [*self.replan, "--view"], [*self.plan, "--threads", "4"]):
            for most in range(1, 9)[::self.options.every]:
                shutil.rmtree(place / "out", ignore_errors=True)
                shell = [*user, "prlimit", f"--nproc={most}", "--"]
                yield self.wrong(self.run([*words, "--out", place / "out"], shell_prefix=shell), f"{most} threads at most")

    def shared_folder(self):
        """Of two runs into one folder at once, one is done, and the other one is refused or waits its turn."""
        for words in (self.plan, [str(word) for word in RACE]):
            for delay_s in (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)[::self.options.every]:
                place = self.new("shared_folder")
                with concurrent.futures.ThreadPoolExecutor(2) as pool:
                    first = pool.submit(self.run, [*words, "--out", place / "out"])
                    time.sleep(delay_s)
                    second = pool.submit(self.run, [*words, "--out", place / "out"])
                    ends = [first.result(), second.result()]
                what = f"two runs, {delay_s} s apart"
                for ended in ends:
                    yield self.wrong(ended, what, (0, 2), "another run")
                if all(ended.code != 0 for ended in ends):
                    yield f"{what}: neither was done"
                elif words is self.plan:
                    yield self.left(place / "out", what)

    def clock_set_back(self):
        for at in (1, 2, 3, 5, 8, 13, 21)[::self.options.every]:
            for words in (self.plan, self.replan, [*self.replan, *WALL]):
                out = self.new("clock_set_back") / "out"
                environment = {"LD_PRELOAD": str(self.options.shim), "FAIL_CALLS": "clock", "FAIL_AT": str(at)}
                ended = self.run([*words, "--out", out], environment=environment)
                yield self.wrong(ended, f"the clock is set back at call {at}", (0,))
                if words is self.plan:
                    yield self.left(out, f"the clock is set back at call {at}")


def check_environment(options):
    surroundings = Surroundings(options)
    names = [name for name, value in vars(Surroundings).items() if not name.startswith("_") and callable(value)
             and name not in ("new", "run", "wrong", "left", "left_but_bag", "in_namespace", "limited")]
    findings = tried = 0
    for name in names:
        if options.only and name not in options.only:
            continue
        before, begin, found = surroundings.runs, time.monotonic(), []
        try:
            for finding in getattr(surroundings, name)():
                if finding:
                    found.append(finding)
                    print(f"NOT SO: {name}: {finding}", flush=True)
            tried += 1
            print(f"{name}: {surroundings.runs - before} runs in {time.monotonic() - begin:.0f} s, {len(found)} findings",
                  flush=True)
        except Skipped as why:
            print(f"{name}: skipped: {why}", flush=True)
        findings += len(found)
    return 77 if tried == 0 else 1 if findings else 0
