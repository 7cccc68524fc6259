#!/usr/bin/python3
"""Injects faults into the built command and holds it to what it promises.

    inject_faults.py SIDESTEP WORK faults [--count N] [--only SCENARIO,...] [--calls KIND,...]
    inject_faults.py SIDESTEP WORK kills [--count N] [--only SCENARIO,...]
    inject_faults.py SIDESTEP WORK environment

`faults` has a call fail in the midst of a run (failing_calls.cpp): an allocation, an open, a read, a write, ...
The command must end by itself, with a documented exit code, and say why; what it calls a success must have the
results of an undisturbed run, and the next run in the folder must succeed. `kills` ends resumable runs by SIGKILL,
and resumes them: what was committed must be there as it was, and the whole must be that of an undisturbed run.
`environment` takes away disk, file handles, threads and address space, and has two runs share a folder.

Common options: --seed S of what is drawn, --at-once N processes (default: one per core), --seconds S after which
nothing more is begun, --every N takes one value in N of an environment, --keep WORK/kept/... of what does not hold,
--messages lists what the runs said, --shim LIBRARY. Ends with 1 where something does not hold, with 77 where nothing
could be tried. WORK/faults.csv and kills.csv have a line for each fault.
"""

import argparse
import collections
import concurrent.futures
import csv
import errno
import math
import os
import pathlib
import random
import re
import resource
import shutil
import sqlite3
import sys
import threading
import time

sys.dont_write_bytecode = True  # of what is imported from here

from runs import CRASH, Outcome, incomplete, rows_of, run
from scenarios import RESUMABLE, SCENARIOS, Bench, fragile_function, read_counts
from surroundings import check_environment

SAVING = "write+sync+rename"
# How a call fails: (how, errno), one of them drawn.
MANNERS = {
    "alloc": [("once", errno.ENOMEM)],
    "large": [("once", errno.ENOMEM), ("always", errno.ENOMEM)],
    "open": [("once", errno.EMFILE), ("once", errno.EACCES), ("once", errno.EIO), ("always", errno.EMFILE)],
    "read": [("once", errno.EIO), ("half", 0), ("once", errno.EINTR), ("always", errno.EIO)],
    "write": [("once", errno.ENOSPC), ("always", errno.ENOSPC), ("once", errno.EIO), ("half", 0), ("once", errno.EINTR)],
    "sync": [("once", errno.EIO), ("always", errno.EIO)],
    "rename": [("once", errno.EACCES), ("once", errno.ENOSPC), ("always", errno.EROFS)],
    "map": [("once", errno.ENOMEM), ("always", errno.ENOMEM)],
    "thread": [("once", errno.EAGAIN), ("always", errno.EAGAIN)],
    "socket": [("once", errno.EMFILE), ("once", errno.ECONNRESET), ("once", errno.EINTR), ("once", errno.EAGAIN),
               ("always", errno.ENOBUFS), ("half", 0)],
    "clock": [("always", 0)],
    "fork": [("once", errno.EAGAIN)],
}
WEIGHTS = {"alloc": 8, "large": 3, "open": 3, "read": 3, "write": 4, "sync": 1, "rename": 2, "map": 1, "thread": 1, "socket": 2,
           "clock": 1, "fork": 1}


def draw_number(count, random_):
    """Half of them evenly, half more often among the first."""
    if random_.random() < 0.5:
        return random_.randint(1, count)
    return max(1, min(count, int(math.exp(random_.uniform(0.0, math.log(count + 1))))))


def verdict_on(bench, place, ended, reached):
    """What does not hold of a disturbed run; empty where all does."""
    if ended.timed_out:
        return "hangs"
    if ended.code < 0:
        return f"ended by signal {-ended.code}"
    if CRASH.search(ended.err):
        return "crash: " + CRASH.search(ended.err)[0]
    if ended.code not in bench.scenario.codes:
        return f"exit code {ended.code}"
    if ended.code != 0 and not reached:
        return f"exit code {ended.code} without a fault"
    try:
        outcome = Outcome(bench.results(place), place / "scratch")
    except (ValueError, sqlite3.DatabaseError) as error:
        return f"damaged: {error}"
    if ended.code == 0:  # a closed loop may have missed a step and recovered
        return incomplete(outcome, bench.reference, bench.scenario.exact and
                          ended.err.count("warning: ") <= bench.warnings)
    if ended.code == 1:
        told = outcome.summary or {}
        return "" if told.get("success") is False and told.get("verdict") else "exit code 1, and nothing says why"
    return "" if len(ended.message()) > 15 else "no message: " + ended.err[-200:]


class Tally:
    """Counts faults, and tells what does not hold as it is found."""

    def __init__(self, options, name):
        self.options, self.lock = options, threading.Lock()
        self.counts, self.messages = collections.Counter(), collections.Counter()
        self.findings = []
        self.begin = self.told = time.monotonic()
        self.file = open(options.work / (name + ".csv"), "w", newline="")
        self.csv = csv.writer(self.file)

    def add(self, scenario, fault, ended, finding, reached=True):
        with self.lock:
            self.counts["not reached" if not reached else "finding" if finding else f"exit code {ended.code}"] += 1
            self.csv.writerow([scenario, fault, ended.code, int(reached), f"{ended.took_s:.2f}", finding, ended.message()])
            self.file.flush()
            if reached and ended.code not in (0, 1):
                self.messages[(ended.code, re.sub(r"\d+|/\S+/", "#", ended.message())[:150])] += 1
            if finding:
                self.findings.append(f"{scenario} [{fault}]: {finding}")
                print(f"NOT SO: {self.findings[-1]}\n    {ended.message()[:300]}", flush=True)
            if time.monotonic() - self.told > 60:
                self.told = time.monotonic()
                print(f"{self.told - self.begin:.0f} s: {dict(self.counts)}", flush=True)

    def end(self, what):
        injected = sum(count for key, count in self.counts.items() if key != "not reached")
        took_s = time.monotonic() - self.begin
        print(f"{injected} {what} in {took_s:.0f} s, {len(self.findings)} findings; "
              f"{dict(sorted(self.counts.items()))}")
        if self.options.messages:
            for (code, message), count in self.messages.most_common():
                print(f"  {count:5} x {code}: {message}")
        return 1 if self.findings or injected == 0 else 0


def is_late(options):
    return options.seconds is not None and time.monotonic() - options.begin > options.seconds


def inject_one(bench, kind, manner, number, place, again):
    how, reason = manner
    counts = place.parent / (place.name + ".counts")
    counts.unlink(missing_ok=True)
    fault = {"FAIL_CALLS": kind, "FAIL_AT": number, "FAIL_HOW": how, "FAIL_ERRNO": reason, "FAIL_COUNTS": counts}
    ended = bench.disturb(place, fault)
    reached = read_counts(counts)[0] >= number
    finding = verdict_on(bench, place, ended, reached)
    if not finding and again:
        after = bench.disturb(place, {}, again=True)
        if after.code != 0 and (ended.code != 2 or "resume" not in bench.scenario.name):
            finding = f"the next run ends with {after.code}: {after.message()}"
        elif after.code == 0:
            try:
                finding = incomplete(Outcome(bench.results(place), place / "scratch"), bench.reference,
                                     bench.scenario.exact)
            except (ValueError, sqlite3.DatabaseError) as error:
                finding = f"damaged: {error}"
            if finding:
                finding = "the next run: " + finding
    return ended, reached, finding


def inject_faults(options):
    wanted = [s for s in SCENARIOS if not options.only or s.name in options.only]
    tally = Tally(options, "faults")
    benches = [Bench(scenario, options) for scenario in wanted]
    for bench in benches:
        print(f"{bench.scenario.name}: {bench.took_s:.2f} s, " +
              ", ".join(f"{kind} {n}" for kind, n in bench.counts.items() if n > 0), flush=True)
    random_ = random.Random(options.seed)
    left = iter(range(options.count))
    lock = threading.Lock()

    def work(worker):
        place = options.work / f"place_{worker}"
        while True:
            with lock:
                number = next(left, None)
                if number is None or is_late(options):
                    return
                bench = random_.choices(benches, [b.scenario.share for b in benches])[0]
                kinds = [k for k in bench.scenario.kinds
                         if bench.counts.get(k, 0) > 0 and (not options.calls or k in options.calls)]
                if not kinds:
                    continue
                kind = random_.choices(kinds, [WEIGHTS[k] for k in kinds])[0]
                manner = random_.choice(MANNERS[kind])
                at = draw_number(bench.counts[kind], random_)
                again = random_.random() < 0.1
            ended, reached, finding = inject_one(bench, kind, manner, at, place, again)
            fault = f"FAIL_CALLS={kind} FAIL_AT={at} FAIL_HOW={manner[0]} FAIL_ERRNO={manner[1]}"
            if finding and options.keep:
                kept = options.work / "kept" / f"{bench.scenario.name}_{kind}_{at}_{manner[0]}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(place, kept)
                (kept / "stderr").write_text(ended.err)
            tally.add(bench.scenario.name, fault, ended, finding, reached)

    in_parallel(options, work)
    return tally.end("faults injected")


def in_parallel(options, work):
    with concurrent.futures.ThreadPoolExecutor(options.at_once) as pool:
        for done in [pool.submit(work, worker) for worker in range(options.at_once)]:
            done.result()


def committed_of(rows):
    """What was said to be saved: every row but of the head, which is written again, and of sessions."""
    heads = ("session", "study", "run", "replan", "benchmark", "robot", "planner")
    return {at: value for at, value in (rows or {}).items() if at[0].split("/")[0] not in heads}


def told_saved(scenario, err, rows):
    """What stderr says is done and the store does not have."""
    if scenario.name == "replan":
        told = {int(n) for n in re.findall(r"^info: episode (\d+): ", err, re.M)}
        has = {at[1] for at in rows if at[0] == "episode"}
        return f"episodes {told - has} were told to be done" if told - has else ""
    if scenario.name == "planner_benchmark":
        told = max([int(n) for n in re.findall(r"^info: \w+ (\d+)/\d+ ", err, re.M)] or [0])
        has = len({(at[0], at[1]) for at in rows if at[0].startswith("solve")})
        return f"{told} answers were told to be done, {has} are saved" if has < told else ""
    return ""


def problems_of_sessions(rows):
    return sum(value for at, value in rows.items() if at[0] == "session" and at[2] == "problems")


def kill_one(bench, number, how, second, place):
    """A run that is killed, killed again where `second` is a number, and resumed."""
    counts = place.parent / (place.name + ".counts")
    counts.unlink(missing_ok=True)
    out = place / "out"
    words = [str(word) for word in bench.scenario.words[:-2]]
    fault = {"FAIL_CALLS": SAVING, "FAIL_AT": number, "FAIL_HOW": how, "FAIL_COUNTS": counts}
    ended = bench.disturb(place, fault)
    if read_counts(counts)[0] < number:
        return ended, "", 0
    kills, saved = 1, {}
    for attempt in range(3):
        try:
            rows = rows_of(out, place / "scratch") or {}
        except sqlite3.DatabaseError as error:
            return ended, f"after kill {kills}: damaged: {error}", kills
        now = committed_of(rows)
        lost = [at for at, value in saved.items() if now.get(at, "nothing") != value]
        if lost:
            return ended, f"lost or done twice after kill {kills}: {len(lost)} rows, e.g. {lost[0]}", kills
        saved = now
        missing = told_saved(bench.scenario, ended.err, now)
        if missing:
            return ended, missing, kills
        environment = {}
        if second and attempt == 0:
            counts.unlink(missing_ok=True)
            environment = {"LD_PRELOAD": str(bench.options.shim), "FAIL_CALLS": SAVING, "FAIL_AT": str(second),
                           "FAIL_HOW": how, "FAIL_COUNTS": str(counts)}
        ended = run([bench.options.sidestep, *words, "--resume", out], environment, bench.limit_s)
        if environment and read_counts(counts)[0] >= second:
            kills += 1
            continue
        if ended.code in (2, 4) and not saved:
            ended = run([bench.options.sidestep, *words, "--out", out], {}, bench.limit_s)
        break
    if ended.timed_out:
        return ended, "hangs", kills
    if ended.code != 0:
        return ended, f"resumed, it ends with {ended.code}: {ended.message()}", kills
    try:
        outcome = Outcome(out, place / "scratch")
    except (ValueError, sqlite3.DatabaseError) as error:
        return ended, f"resumed: damaged: {error}", kills
    lost = [at for at, value in saved.items() if outcome.rows.get(at, "nothing") != value]
    if lost:
        return ended, f"lost or done twice: {len(lost)} rows, e.g. {lost[0]}", kills
    finding = incomplete(outcome, bench.reference, True)
    done, expected = problems_of_sessions(outcome.rows), problems_of_sessions(bench.reference.rows)
    if not finding and done != expected:
        finding = f"{done} problems were done in all sessions, not {expected}"
    return ended, finding, kills


def inject_kills(options):
    wanted = [s for s in RESUMABLE if not options.only or s.name in options.only]
    tally = Tally(options, "kills")
    benches = [Bench(scenario, options) for scenario in wanted]
    total = {b: sum(b.counts[kind] for kind in SAVING.split("+")) for b in benches}
    for bench in benches:
        print(f"{bench.scenario.name}: {bench.took_s:.2f} s, {total[bench]} calls of {SAVING}", flush=True)
    random_ = random.Random(options.seed)
    lock = threading.Lock()
    killed = 0

    def work(worker):
        nonlocal killed
        place = options.work / f"place_{worker}"
        while True:
            with lock:
                if killed >= options.count or is_late(options):
                    return
                bench = random_.choice(benches)
                number = random_.randint(1, total[bench])
                how = random_.choice(["kill", "torn", "killall", "tornall"])
                second = random_.randint(1, total[bench]) if random_.random() < 0.3 else None
            ended, finding, kills = kill_one(bench, number, how, second, place)
            with lock:
                killed += kills
            if finding and options.keep:
                kept = options.work / "kept" / f"kill_{bench.scenario.name}_{number}_{how}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(place, kept)
            tally.add(bench.scenario.name, f"{SAVING} {number} {how}, then {second}", ended, finding, kills > 0)

    in_parallel(options, work)
    code = tally.end("runs killed and resumed")
    print(f"{killed} kills")
    return code


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sidestep", type=pathlib.Path)
    parser.add_argument("work", type=pathlib.Path)
    parser.add_argument("what", choices=["faults", "kills", "environment"])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda text: text.split(","))
    parser.add_argument("--calls", type=lambda text: text.split(","))
    parser.add_argument("--at-once", type=int, default=os.cpu_count())
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--shim", type=pathlib.Path)
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--messages", action="store_true")
    options = parser.parse_args()
    options.begin = time.monotonic()
    options.sidestep, options.work = options.sidestep.resolve(), options.work.resolve()
    options.work.mkdir(parents=True, exist_ok=True)
    options.shim = (options.shim or options.sidestep.parent.parent / "tests" / "faults" / "libfailing_calls.so").resolve()
    if not options.shim.exists():
        print(f"skipped: there is no {options.shim}")
        return 77
    options.spares = fragile_function(options.sidestep)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ["SIDESTEP_INSTRUCTIONS"] = os.environ.get("SIDESTEP_INSTRUCTIONS", "any")
    return {"faults": inject_faults, "kills": inject_kills, "environment": check_environment}[options.what](options)


if __name__ == "__main__":
    sys.exit(main())
