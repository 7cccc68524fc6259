"""The runs that are attacked, what they must be afterwards, and all that somebody without the token has heard of them."""

import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "faults"))

from runs import CRASH, Outcome, first_difference, lasting, settled, settled_rows
from wire import PING, PONG, Line, answers_in, frame, kind_of

CONFIG = HERE.parent / "integration" / "configs" / "tiny_replan.yaml"
SECRET = b"this is none of the page"
SAYINGS = re.compile(rb"[A-Z][^<>{}\"\\]{5,90}\.\n")  # a sentence for people
REFUSALS = (400, 403, 404, 405, 413, 426, 431, 503)
GETS_IN_S = 5.0  # the longest that a page may take, whoever else is there; ten times what it takes alone, if that is more
GROWTH_MIB = {False: 64, True: 192}  # of the process beyond one with a page; with the token or not
MOST_CONNECTIONS = 128


class Finding(Exception):
    """What does not hold."""


def expect(condition, text):
    if not condition:
        raise Finding(text)


def install(command, work):
    """An installation with the page of this build, or a page of its own, in which links lead out of it."""
    prefix, built = work / "prefix", command.parent.parent
    shutil.rmtree(prefix, ignore_errors=True)
    (prefix / "lib" / "sidestep").mkdir(parents=True)
    (prefix / "share" / "sidestep").mkdir(parents=True)
    for library in ("libsidestep_runtime.so.1", "libsidestep_sdk.so.1"):
        shutil.copy(built / "lib" / library, prefix / "lib" / library)
    (prefix / "lib" / "sidestep" / "plugins").symlink_to(built / "lib" / "sidestep" / "plugins")
    for folder in ("robots", "configs"):
        (prefix / "share" / "sidestep" / folder).symlink_to(built / "share" / "sidestep" / folder)
    page = prefix / "share" / "sidestep" / "viewer"
    if (built / "share" / "sidestep" / "viewer" / "index.html").exists():
        shutil.copytree(built / "share" / "sidestep" / "viewer", page)
    else:
        (page / "parts").mkdir(parents=True)
        (page / "index.html").write_text("<script src=viewer.js></script>")
        (page / "viewer.js").write_text("//" + 700_000 * "x")
    (prefix / "share" / "sidestep" / "secret.txt").write_bytes(SECRET)
    (page / "link.txt").symlink_to(prefix / "share" / "sidestep" / "secret.txt")
    (page / "up").symlink_to(prefix)
    return prefix


class Place:
    """Where a viewer is, and the token that it asks for."""

    def __init__(self, port, token):
        self.port, self.token, self.alone_s = port, token, 0.0
        self.query = f"?token={token}" if token else ""

    def alive(self):
        return True

    def guest(self, fields="", **options):
        """A socket with the token."""
        line = Line(self.port, **options)
        status = line.ask_for_socket("/socket" + self.query, fields)
        if status != 101:
            line.close()
            raise Finding(f"a page with the token is answered {status or 'nothing'}")
        return line

    def stranger(self, **options):
        """A connection of somebody who has no token."""
        return Line(self.port, **options)


class Target(Place):
    """A run with a viewer."""

    def __init__(self, bench, out, words, limits=None, path=None):
        self.bench, self.out, self.err, self.url = bench, out, "", None
        self.begun = time.monotonic()
        environment = {**os.environ, "LC_ALL": "C", "LD_LIBRARY_PATH": str(bench.prefix / "lib"),
                       **({"PATH": path} if path else {})}
        self.process = subprocess.Popen(
            [bench.command, "run", *map(str, words), "--out", out], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env=environment, start_new_session=True, preexec_fn=limits)
        self.peak_kib = self.most_files = 0
        self.streams = [threading.Thread(target=self._read, args=(s,), daemon=True)
                        for s in (self.process.stdout, self.process.stderr)]
        self.said = {self.process.stdout: "", self.process.stderr: ""}
        self.told = threading.Event()
        for stream in self.streams:
            stream.start()
        if "--view" in words:
            self.told.wait(60)
            expect(self.url, f"no viewer: {self.said[self.process.stderr]}")
            at = re.match(r"http://127\.0\.0\.1:(\d+)/(?:\?token=(\w+))?$", self.url)
            super().__init__(int(at[1]), at[2])
            threading.Thread(target=self._weigh, daemon=True).start()

    def _read(self, stream):
        for line in stream:
            self.said[stream] += line.decode(errors="replace")
            if found := re.search(rb"viewer: (http://\S+)", line):
                self.url = found[1].decode()
                self.told.set()
        self.told.set()

    def _weigh(self):
        while self.process.poll() is None:
            try:
                worker = self.worker()
                status = pathlib.Path(f"/proc/{worker}/status").read_text()
                self.peak_kib = max(self.peak_kib, int(re.search(r"VmHWM:\s+(\d+)", status)[1]))
                self.most_files = max(self.most_files, len(os.listdir(f"/proc/{worker}/fd")))
            except (OSError, TypeError):
                pass
            time.sleep(0.05)

    def worker(self):
        """The process that runs the loop; the first one waits for it."""
        pid = self.process.pid
        children = pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return int(children[0]) if children else pid

    def alive(self):
        return self.process.poll() is None

    def wait(self, limit_s=600.0):
        try:
            self.process.wait(limit_s)
        except subprocess.TimeoutExpired:
            self.kill()
            raise Finding("the run does not end") from None
        for stream in self.streams:
            stream.join(5)
        return self.process.returncode

    def kill(self):
        if self.alive():
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def stranger(self, **options):
        """A connection of somebody who has no token; what it hears is kept."""
        heard = bytearray()
        self.bench.heard.append(heard)
        return Line(self.port, heard=heard.extend, **options)

    def page_gets_in(self, limit_s=None):
        """How long a page took to be whole and told of the world; it tries again as people do."""
        limit_s = limit_s or max(GETS_IN_S, 10.0 * self.alone_s)
        begin, tries, why = time.monotonic(), 0, ""
        while (left_s := begin + limit_s - time.monotonic()) > 0 and self.alive():
            tries += 1
            try:
                for target in ("/" + self.query, "/viewer.js"):
                    with Line(self.port, patience_s=left_s) as line:
                        answers = line.get(target, limit_s=left_s)
                        if len(answers) != 1 or answers[0].status != 200 or \
                                len(answers[0].body) != int(answers[0].fields[b"Content-Length"]):
                            why = f"{target.split('?')[0]}: " + (str(answers[0].status) if answers else "no answer")
                            raise OSError(why)
                with self.guest(patience_s=left_s) as line:
                    message = line.frame()
                    if message and kind_of(message[1])[0] == "world" and time.monotonic() < begin + limit_s:
                        return time.monotonic() - begin
                    why = "the socket tells nothing"
            except (OSError, Finding) as error:
                why = str(error)
            time.sleep(0.1)
        if not self.alive():
            raise OSError("the run has ended")
        raise Finding(f"no page gets in within {limit_s:.0f} s and {tries} tries; last: {why}")


class Bench:
    """Where runs are attacked: one after the other, all of one configuration and seed, the next one when one is over."""

    def __init__(self, command, work, episodes):
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        self.command, self.work, self.episodes = command, work, episodes
        self.prefix = install(command, work)
        self.assets = {f.read_bytes() for f in (self.prefix / "share/sidestep/viewer").rglob("*")
                       if f.is_file() and not f.is_symlink() and f.suffix != ".html"}
        self.heard, self.targets, self.counter = [], [], 0
        self.reference = self.undisturbed = None

    def words(self, *more):
        return [CONFIG, "--set", f"experiment.episodes={self.episodes}", "--set", "experiment.pictures=0", *more]

    def begin(self, *more, **options):
        self.counter += 1
        return Target(self, self.work / f"run_{self.counter}", self.words(*more), **options)

    def measure_undisturbed(self):
        """The run that all others are held against, with a page that looks on and one that does not."""
        alone, watched = self.begin(), self.begin("--view", "--view-bind", "127.0.0.1")
        with watched.guest() as line:
            while (got := line.frame()) is not None:
                if got[0] == PING:
                    line.send(frame(PONG, got[1]))
        for target in (alone, watched):
            target.wait()
        self.reference, self.undisturbed = self.outcome(alone), watched
        expect(self.reference.rows is not None, "the undisturbed run has left no results")
        self.judge(watched)
        return f"{len(self.reference.rows)} rows, at most {watched.peak_kib >> 10} MiB, {watched.most_files} files open"

    def target(self):
        """A run that goes on."""
        if not self.targets or not self.targets[-1].alive():
            self.targets.append(self.begin("--view", "--view-bind", "127.0.0.1"))
            self.targets[-1].alone_s = self.targets[-1].page_gets_in(60.0)
        return self.targets[-1]

    def outcome(self, target):
        return Outcome(target.out, self.work / "scratch")

    def judge(self, target, growth_mib=None):
        """Whether a run that is over is what it would have been."""
        code = target.wait()
        err = target.said[target.process.stderr]
        expect(not CRASH.search(err), f"crash: {err[-300:]}")
        expect(code in (0, 1), f"exit code {code}: {err[-300:]}")
        outcome = self.outcome(target)
        expect(outcome.summary is not None and outcome.rows is not None and outcome.page_is_whole, "results are missing")
        expect(lasting(outcome.files) == lasting(self.reference.files), "its files are others than those of an undisturbed run")
        for one, other in ((settled(outcome.summary), settled(self.reference.summary)),
                           (settled_rows(outcome.rows), settled_rows(self.reference.rows))):
            difference = first_difference(one, other)
            expect(not difference, "its results are others than those of an undisturbed run: " + difference)
        verdicts = [o.summary["verdict"] for o in (outcome, self.reference)]
        expect(verdicts[0] == verdicts[1], f"its verdict is another: {verdicts[0]}")
        if growth_mib is not None:
            grown = (target.peak_kib - self.undisturbed.peak_kib) / 1024
            expect(grown <= growth_mib, f"it grew by {grown:.0f} MiB, of at most {growth_mib}")
            return f"{len(outcome.rows)} rows as undisturbed, {grown:.0f} MiB more"
        return f"{len(outcome.rows)} rows as undisturbed"

    def hear_strangers(self):
        """Whether those without the token have heard what is for all, and nothing else."""
        tokens = [t.token.encode() for t in self.targets if t.token]
        for heard in map(bytes, self.heard):
            expect(SECRET not in heard and not any(t in heard for t in tokens), "a secret was told")
            for answer in answers_in(heard):
                if answer.status == 0:  # cut off in its head, or no answer
                    expect(b"HTTP/1.1 200 OK".startswith(answer.body[:15]), f"told without the token: {answer.body[:60]}")
                elif answer.status == 200:
                    whole = any(asset.startswith(answer.body) for asset in self.assets)
                    expect(whole, f"served without the token: {answer.body[:60]}")
                else:
                    expect(answer.status in REFUSALS, f"answered {answer.status} without the token")
                    expect(not answer.body or SAYINGS.fullmatch(answer.body), f"told without the token: {answer.body[:60]}")
        count, self.heard = len(self.heard), []
        return count


def limit_files(count):
    return lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (count, count))
