"""What attacks cost in time: a loop's steps beside a crowd and without one, by turns; and what a guess's time tells."""

import os
import pathlib
import signal
import statistics
import subprocess
import sys
import threading
import time

from bench import HERE, expect
from wire import BINARY, PING, PONG, frame, kind_of

MOST_RATIO = 1.2  # of the 95th percentile of a step beside a crowd to that of one without
LEAST_PER_S = 10  # times that a crowd connects or sends something, or it is none


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def watch(target, steps, frames):
    """Reads as a page does until the run is over, and keeps the times that the loop tells."""
    with target.guest(patience_s=60.0) as line:
        while (got := line.frame()) is not None:
            if got[0] == PING:
                line.send(frame(PONG, got[1]))
            if got[0] == BINARY:
                kind, header = kind_of(got[1])
                if kind == "timing":
                    steps += [step_ms for _, step_ms in header["steps"]]
                    frames += [one[3] + one[4] for one in header["frames"]]


def one_round(bench, words, crowd):
    """The times of a run's steps and frames, the time that the loop's thread and the viewer's worked, and how often a second a
    crowd did something beside it; `crowd` may be None."""
    target = bench.begin("--view", "--view-bind", "127.0.0.1", *words)
    bench.targets.append(target)
    steps, frames, worked_s = [], [], {}
    reader = threading.Thread(target=watch, args=(target, steps, frames), daemon=True)
    reader.start()
    besieging, begin = None, time.monotonic()
    if crowd:
        besieging = subprocess.Popen([sys.executable, HERE / "besiege.py", str(target.port), target.token, crowd],
                                     stdout=subprocess.PIPE, start_new_session=True)
    while target.alive():
        note_work(target, worked_s)
        time.sleep(0.1)
    lasted_s = time.monotonic() - begin
    target.wait()
    reader.join(10)
    acts = 0
    if besieging:
        besieging.send_signal(signal.SIGTERM)
        acts = int(besieging.communicate(timeout=60)[0] or 0)
    bench.targets.remove(target)
    expect(len(steps) > 50, f"{len(steps)} steps were told")
    loop_s = max(s for s, nice in worked_s.values() if nice < 19)
    viewer_s = sum(s for s, nice in worked_s.values() if nice == 19)
    return {"steps": steps, "frames": frames, "thread": [loop_s]}, acts / lasted_s, viewer_s / lasted_s


def note_work(target, worked_s):
    """How long each thread of the loop's process has worked, and its nice value."""
    try:
        for task in pathlib.Path(f"/proc/{target.worker()}/task").iterdir():
            values = (task / "stat").read_text().rsplit(")", 1)[1].split()
            worked_s[task.name] = ((int(values[11]) + int(values[12])) / os.sysconf("SC_CLK_TCK"), int(values[16]))
    except OSError:
        pass


def compared(bench, words, crowd, rounds):
    """Runs with a crowd and without one by turns: the ratios of the quantiles of all, and in brackets the least and the
    greatest of the pairs. Without a crowd, of two like runs."""
    taken, per_s, shares, told, pooled = {True: [], False: []}, [], [], [], {}
    for i in range(rounds):
        for with_crowd in (i % 2 == 1, i % 2 == 0):
            times, acts, share = one_round(bench, words, crowd if with_crowd else None)
            taken[with_crowd].append(times)
            if with_crowd:
                per_s.append(acts)
                shares.append(share)
    for what, share in (("steps", 50), ("steps", 90), ("steps", 95), ("steps", 99), ("frames", 50), ("frames", 95), ("thread", 50)):
        pairs = sorted(quantile(on[what], share / 100) / quantile(off[what], share / 100)
                       for on, off in zip(taken[True], taken[False], strict=True))
        all_on, all_off = ([t for one in taken[w] for t in one[what]] for w in (True, False))
        pooled[what, share] = quantile(all_on, share / 100) / quantile(all_off, share / 100)
        told.append(f"{what} p{share} {pooled[what, share]:.2f} ({pairs[0]:.2f} to {pairs[-1]:.2f})")
    told.append(f"the viewer's threads took {100 * statistics.median(shares):.1f} % of a core")
    return pooled["steps", 95], statistics.median(per_s), ", ".join(told)


def steps(bench, rounds):
    """By the wall's clock, and in lockstep, where both do the same work. One step in twenty plans, and takes fifty times as long as
    the others: the 95th percentile lies on that edge, so that the 90th and the 99th tell more."""
    wall = ["--set", "experiment.clock=wall", "--set", "experiment.episodes=1"]
    lockstep = ["--set", "experiment.episodes=40"]
    later = []
    for name, words in (("the wall's clock", wall), ("lockstep", lockstep)):
        for crowd in (None, "strangers", "guests"):
            ratio, per_s, told = compared(bench, words, crowd, rounds)
            told = f"{crowd or 'nobody'} by {name}, {rounds} pairs, {per_s:.0f} acts/s: {told}"
            print("        ", told, flush=True)
            if crowd and per_s < LEAST_PER_S:
                later.append("the crowd came to nothing: " + told)
            elif crowd and ratio > MOST_RATIO:
                later.append("steps are later: " + told)
    expect(not later, "; ".join(later))
    return f"none is later by more than {MOST_RATIO} (p95)"


def token_times(bench, scale):
    """Whether a guess takes longer the more of it is right: 1,000 times with the first character wrong and with the last."""
    target, count = bench.target(), int(1000 * scale)
    token = target.token
    guesses = [("1" if token[0] == "0" else "0") + token[1:], token[:-1] + ("1" if token[-1] == "0" else "0")]
    times_us = [[], []]
    for i in range(2 * count):
        which = (i + i // 2) % 2
        with target.stranger() as line:
            request = f"GET /?token={guesses[which]} HTTP/1.1\r\nHost: {line.host}\r\n\r\n".encode()
            begin = time.perf_counter()
            line.send(request)
            head = line.more() or b""
            times_us[which].append(1e6 * (time.perf_counter() - begin))
            if not head.startswith(b"HTTP/1.1 403"):
                raise OSError("a guess is not answered")
    first, last = (statistics.median(t) for t in times_us)
    spread = [quantile(t, 0.75) - quantile(t, 0.25) for t in times_us]
    noise_us = 1.57 * max(spread) / count**0.5  # of a median, at 95 %
    told = f"{first:.1f} us with the first wrong, {last:.1f} us with the last; +- {noise_us:.1f} us"
    expect(abs(last - first) <= max(10.0, 3.0 * noise_us), "the time tells how much is right: " + told)
    return told
