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

from bench import Place
from guests import come_and_go_of, ping_of, visit, wish_of
from strangers import Crowd, ask_slowly, drip, wait_silently


def guess(place, over, counts):
    while not over.is_set():
        try:
            with place.stranger(patience_s=5.0) as line:
                line.get(f"/?token={random.getrandbits(128):032x}")
                counts[1] += 1
        except OSError:
            time.sleep(0.05)


def main():
    port, token, kind = sys.argv[1:]
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # what is measured is the viewer, not what shares its machine
    try:
        pathlib.Path("/proc/self/autogroup").write_text("19")
    except OSError:
        pass
    over, counts = threading.Event(), [0, 0]
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    place = Place(int(port), token)
    if kind == "strangers":
        crowds = [Crowd(place, 300, wait_silently, workers=1), Crowd(place, 100, ask_slowly, 1, workers=1),
                  Crowd(place, 100, drip, workers=1)]
        threads = [threading.Thread(target=guess, args=(place, over, counts), daemon=True) for _ in range(2)]
    else:
        crowds = []
        acts = [wish_of] * 8 + [ping_of] * 2 + [come_and_go_of] * 8
        threads = [threading.Thread(target=visit, args=(place, over.is_set, act, i, counts), daemon=True) for i, act in enumerate(acts)]
    for thread in threads:
        thread.start()
    over.wait()
    for crowd in crowds:
        crowd.over.set()
    print(counts[1] + sum(crowd.opened for crowd in crowds), flush=True)
    os._exit(0)


main()
