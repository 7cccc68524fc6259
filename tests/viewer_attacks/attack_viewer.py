#!/usr/bin/python3
"""Attacks the viewer of runs, and holds them to what they are without.

    attack_viewer.py SIDESTEP WORK [--quick] [--only NAME,...] [--episodes N] [--pairs N]

A closed loop in lockstep, of which a seed makes one run, is shown by a viewer that asks for a token, and attacked: by
strangers, who have no token, and by guests, who have it. Each attack is a function of strangers.py or guests.py. After
each, what strangers have heard is what is for all; a page gets in beside the crowd; and the run, when it is over, has
the verdict, rows and files of an undisturbed one, and has grown no larger than it may. Then the token is looked for in
what the run has left and in the command lines of all processes. With --pairs, so many pairs of runs, one of each with a
crowd beside it, tell whether its steps are later (times.py). Ends with 1 where something does not hold.
"""

import argparse
import pathlib
import sys
import time

sys.dont_write_bytecode = True

from bench import GROWTH_MIB, Bench, Finding
from guests import GUESTS
from strangers import STRANGERS
from times import steps, token_times
from traces import TRACES


def attempt(bench, attack, scale):
    """What an attack did; it begins anew where the run was over meanwhile, whatever that looked like."""
    for _ in range(6):
        bench.heard = []
        try:
            told = attack(bench, scale)
            bench.hear_strangers()
            return told
        except (OSError, Finding) as error:
            why = error if isinstance(error, Finding) else Finding(f"{type(error).__name__}: {error}")
            time.sleep(0.5)
            if not bench.targets or bench.targets[-1].alive():
                break
    raise why


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("command", type=pathlib.Path)
    parser.add_argument("work", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--episodes", type=int)
    parser.add_argument("--pairs", type=int, default=0)
    options = parser.parse_args()
    scale, only = 0.4 if options.quick else 1.0, [n for n in options.only.split(",") if n]
    begin, findings = time.monotonic(), 0

    def report(name, act):
        nonlocal findings
        since = time.monotonic()
        try:
            verdict, told = "holds", act()
        except Finding as finding:
            verdict, told, findings = "FINDING", str(finding), findings + 1
        print(f"{verdict:8} {name:20} {time.monotonic() - since:5.1f} s  {told}", flush=True)

    bench = Bench(options.command.resolve(), options.work.resolve(), options.episodes or (60 if options.quick else 200))
    try:
        report("undisturbed", bench.measure_undisturbed)
        if findings:
            return 1
        for has_token, attacks in ((False, [*STRANGERS, token_times]), (True, GUESTS), (None, TRACES)):
            first = len(bench.targets)
            for attack in attacks:
                if not only or attack.__name__ in only:
                    report(attack.__name__, lambda attack=attack: attempt(bench, attack, scale))
            for i, target in enumerate(bench.targets[first:]):
                report(f"run {first + i + 1}", lambda t=target, g=GROWTH_MIB.get(has_token): bench.judge(t, g))
        if options.pairs:
            report("steps", lambda: steps(bench, options.pairs))
    finally:
        for target in bench.targets:
            target.kill()
    print(f"{findings} findings in {time.monotonic() - begin:.0f} s", flush=True)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
