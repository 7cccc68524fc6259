#!/usr/bin/python3
"""Tries branch_coverage.py and mutate.py on toy/toy.cpp, whose branches and mutants are counted here by hand.

    check_scripts.py branches|changes WORK

Ends with 77 where what it needs is not installed.
"""

import os
import pathlib
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True

from branch_coverage import read_counts
from core import HERE

TOY = HERE / "toy" / "toy.cpp"
# Line: branches, and how many are taken. Calls that may throw, and strings that must be destroyed then, add none, nor does
# `? 0 : 1`, which is computed.
BRANCHES = {9: (4, 4), 14: (2, 1), 25: (2, 1)}
# Mutants of each kind, counted in the source: two of each comparison by size.
KINDS = {"arithmetic": 5, "comparison": 7, "condition": 2, "literal": 11, "logic": 1, "min and max": 1, "statement": 6}
# What the program's sum, 8 = limited(-1, 3) + limited(5, 3) + limited(1, 3), does not show without arguments.
SURVIVORS = {
    (9, "value < 0", "value <= 0"), (9, "0", "0 + 1"), (9, "value > most", "value >= most"),  # no value is 0 or 3
    (14, 'throw std::invalid_argument("nothing")', ""), (15, "3", "3 + 1"),  # no text is empty or long
    (22, "1", "1 + 1"), (23, "5", "5 + 1"),  # -2 is negative as well, 6 more than 3
    (25, "1", "1 + 1"), (25, "sum += argc", ""),
    (25, "sum += argc", "sum -= argc"), (28, "1", "1 + 1"),  # no arguments, no failure
    (27, "--spare", ""),  # which nobody reads
}
NOT_REACHED = {(28, "1"), (14, 'throw std::invalid_argument("nothing")'), (25, "sum += argc")}


def check_branches(work):
    shutil.copy(TOY, work)
    subprocess.run(["g++", "-std=c++20", "-O0", "--coverage", "-c", "toy.cpp"], cwd=work, check=True)
    subprocess.run(["g++", "--coverage", "toy.o", "-o", "toy"], cwd=work, check=True)
    notes = [work / "toy.gcno"]
    unseen = read_counts(notes, work, {"toy.cpp"})["toy.cpp"]
    subprocess.run([work / "toy"], cwd=work, check=True)
    seen = read_counts(notes, work, {"toy.cpp"})["toy.cpp"]
    found = {line: (len(counts), sum(count > 0 for count in counts)) for line, counts in seen.items() if counts}
    none = {line: (len(counts), sum(count > 0 for count in counts)) for line, counts in unseen.items() if counts}
    if found != BRANCHES or none != {line: (count, 0) for line, (count, _) in BRANCHES.items()}:
        sys.exit(f"branches are {BRANCHES}, counted {found}; before the program ran {none}")


def check_changes(work):
    try:
        from mutate import Mutated
    except ImportError:
        print("python3-clang-14 is not installed")
        sys.exit(77)
    mutated = Mutated(str(TOY), ["-std=c++20"], 5)
    (work / "toy.cpp").write_bytes(mutated.source())
    subprocess.run(["g++", "-std=c++20", "-w", f"-I{HERE}", "toy.cpp", "-o", "toy"], cwd=work, check=True)

    def outcome(number):
        try:
            return subprocess.run([work / "toy"], env={**os.environ, "SIDESTEP_MUTANT": str(number),
                                                       "SIDESTEP_REACHED": str(work / "reached")},
                                  stderr=subprocess.DEVNULL, timeout=20).returncode
        except subprocess.TimeoutExpired:
            return -1

    if outcome(-1) != 0:
        sys.exit("the program fails without a mutant")
    reached = {int(line) for line in (work / "reached").read_text().split()}
    for i, (line, kind, before, after) in enumerate(mutated.mutants, 5):
        survives = outcome(i) == 0
        if survives != ((line, before, after) in SURVIVORS):
            sys.exit(f"line {line}: {before} -> {after or 'nothing'} {'survives' if survives else 'is killed'}")
        if (i in reached) == ((line, before) in NOT_REACHED):
            sys.exit(f"line {line}: {before} -> {after or 'nothing'} is{'' if i in reached else ' not'} reached")
    if [sum(kind == one for _, one, _, _ in mutated.mutants) for kind in sorted(KINDS)] != [KINDS[kind] for kind in sorted(KINDS)]:
        sys.exit(f"there are {KINDS}, found {mutated.mutants}")


def main():
    work = pathlib.Path(sys.argv[2])
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        {"branches": check_branches, "changes": check_changes}[sys.argv[1]](work)
    finally:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
