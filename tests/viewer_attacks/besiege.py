#!/usr/bin/python3
"""A crowd around a viewer, of idle priority, until it is told to end; then prints how often it has connected or sent something.

    besiege.py PORT TOKEN strangers|guests
"""

import os
import pathlib
import random
import signal
import sys
import threading
import time

sys.dont_write_bytecode = True

from bench import Finding, Place
from guests import come_and_go_of, ping_of, wish_of
from strangers import Crowd, ask_slowly, drip, wait_silently


def guess(place, over, count):
    while not over.is_set():
        try:
            with place.stranger(patience_s=5.0) as line:
                line.get(f"/?token={random.getrandbits(128):032x}")
                count[0] += 1
        except OSError:
            time.sleep(0.05)


def visit(place, over, count, act, number):
    line, state = None, {}
    while not over.is_set():
        try:
            if line is None:
                line, state = place.guest(patience_s=2.0), {"number": number}
            count[0] += 1
            if act(line, state) is False:
                line.close()
                line = None
        except (OSError, Finding):
            if line is not None:
                line.close()
            line = None
            time.sleep(0.05)


def main():
    port, token, kind = sys.argv[1:]
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # what is measured is the viewer, not what shares its machine
    try:
        pathlib.Path("/proc/self/autogroup").write_text("19")
    except OSError:
        pass
    over, count = threading.Event(), [0]
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    place = Place(int(port), token)
    if kind == "strangers":
        crowds = [Crowd(place, 300, wait_silently, workers=1), Crowd(place, 100, ask_slowly, 1, workers=1),
                  Crowd(place, 100, drip, workers=1)]
        threads = [threading.Thread(target=guess, args=(place, over, count), daemon=True) for _ in range(2)]
    else:
        crowds = []
        acts = [wish_of] * 8 + [ping_of] * 2 + [come_and_go_of] * 8
        threads = [threading.Thread(target=visit, args=(place, over, count, act, i), daemon=True) for i, act in enumerate(acts)]
    for thread in threads:
        thread.start()
    over.wait()
    for crowd in crowds:
        crowd.over.set()
    print(count[0] + sum(crowd.opened for crowd in crowds), flush=True)
    os._exit(0)


main()
