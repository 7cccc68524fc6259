#!/usr/bin/python3
"""Measures which branches of the safety core its unit tests take, by gcov.

    branch_coverage.py [--build FOLDER] [--bound SHARE] [--missing] [--no-build] [--no-run] [--only TEST,...]

Builds the tests that core.py names in build/coverage, its sources unoptimised, runs them, and prints for each file how
many branches it has and how many were taken. Ends with 1 where the share of all is under the bound (95 %).

A branch is a way out of a condition that the source has. g++ counts more, which are left out:
- the two ways out of each call that may throw: gcov marks one `throw`, the one before it is the call's return;
- those of blocks that only an exception reaches;
- conditions of lines without any: destructors of what may not have been built, guards of static objects.
- the choice of a kernel by the processor (SIDESTEP_DISPATCH).
A function that is compiled several times, a template or a kernel for several instruction sets, counts once: a branch is
taken where one of its copies takes it.
"""

import argparse
import collections
import json
import pathlib
import re
import subprocess
import sys

sys.dont_write_bytecode = True

import core

# What makes a condition in C++. Macros of tests, assertions and the like do not occur in the core.
CONDITION = re.compile(r"\b(if|for|while|case|switch|default)\b|&&|\|\||\?")

KERNEL_COPIES = 3


def code_of(line):
    """A line without its comment and its literals; nothing of one that the processor decides."""
    if "SIDESTEP_DISPATCH" in line:
        return ""
    return re.sub(r'"(\\.|[^"\\])*"|//.*', '""', line)


def run_gcov(note, root, *options):
    return subprocess.run(["gcov", "--stdout", "--branch-probabilities", "--relative-only", "--source-prefix", root, *options,
                           note.name], cwd=note.parent, check=True, capture_output=True, text=True).stdout


def exceptional_branches(text):
    """{(file, line, function): [whether only an exception leads there, of each branch]}, from gcov's text.

    The function is that of a copy; None where there is one only.
    """
    found = collections.defaultdict(list)
    name, number, copy, is_exceptional = "", 0, None, False
    for line in text.splitlines():
        block = re.match(r" *([\d$%]+)\*?: *\d+-block +\d+$", line)
        beginning = re.match(r" *\S+: *(\d+):(Source:(.*))?", line)
        if line.startswith("branch"):
            found[name, number, copy].append(is_exceptional)
        elif block:
            is_exceptional = block[1].startswith("$")
        elif beginning:
            number, is_exceptional = int(beginning[1]), False
            if beginning[2] and number == 0:
                name, copy = beginning[3], None
        elif line.startswith("------"):
            copy = None
        elif re.match(r"\S+:$", line):
            copy = line[:-1]
    return found


def own_branches(branches, exceptional):
    """The counts of a line's branches without those of calls that may throw, and of what only an exception reaches."""
    kept = []
    for branch, is_exceptional in zip(branches, exceptional):
        if branch["throw"]:
            if kept and kept[-1][0]["fallthrough"]:
                kept.pop()  # the return of the same call
        else:
            kept.append((branch, is_exceptional))
    return [branch["count"] for branch, is_exceptional in kept if not is_exceptional]


def read_counts(notes, root, wanted):
    """{file: {line: [count of each branch]}} of the objects whose notes these are."""
    found = collections.defaultdict(lambda: collections.defaultdict(dict))
    sources = {name: (root / name).read_text().splitlines() for name in wanted}
    # Where the part begins that is compiled for each instruction set (core/each_target.hpp).
    kernels = {name: lines.index("#else") if any("#define SIDESTEP_KERNELS" in line for line in lines) else len(lines)
               for name, lines in sources.items()}
    for note in notes:
        exceptional = exceptional_branches(run_gcov(note, root, "--all-blocks"))
        for document in run_gcov(note, root, "--json-format").splitlines():
            for file in json.loads(document)["files"]:
                name = file["file"].removeprefix(f"{root}/")
                if name not in wanted:
                    continue
                places = {function["name"]: (function["start_line"], function["start_column"])
                          for function in file["functions"]}
                for line in file["lines"]:
                    number, function = line["line_number"], line.get("function_name")
                    if not CONDITION.search(code_of(sources[name][number - 1])):
                        continue
                    flags = exceptional.get((name, number, function)) or exceptional.get((name, number, None)) or []
                    if len(flags) != len(line["branches"]):
                        flags = [False] * len(line["branches"])
                    counts = own_branches(line["branches"], flags)
                    if function is None and number > kernels[name] and len(counts) % KERNEL_COPIES == 0:
                        # Copies that are inlined everywhere stand behind each other.
                        each = len(counts) // KERNEL_COPIES
                        counts = [sum(counts[i::each]) for i in range(each)]
                    key = (places.get(function), len(counts))
                    of_line = found[name][number]
                    of_line[key] = [a + b for a, b in zip(of_line.get(key, [0] * len(counts)), counts)]
    return {name: {number: [count for counts in of_line.values() for count in counts]
                   for number, of_line in lines.items()} for name, lines in found.items()}


def report(counts, order, missing, root):
    """Prints the table; returns the share of the branches that were taken."""
    print(f"{'branches':>9} {'taken':>6} {'share':>7}  file")
    all_of_them = all_taken = 0
    for name in order:
        branches = [count for counts_of_line in counts.get(name, {}).values() for count in counts_of_line]
        taken = sum(count > 0 for count in branches)
        all_of_them, all_taken = all_of_them + len(branches), all_taken + taken
        if branches:
            print(f"{len(branches):9} {taken:6} {100 * taken / len(branches):6.1f}%  {name}")
    share = 100 * all_taken / all_of_them if all_of_them else 0.0
    print(f"{all_of_them:9} {all_taken:6} {share:6.1f}%  all")
    if missing:
        for name in order:
            lines = (root / name).read_text().splitlines()
            for number, of_line in sorted(counts.get(name, {}).items()):
                if not all(of_line):
                    print(f"{name}:{number}: {of_line.count(0)} of {len(of_line)} not taken: {lines[number - 1].strip()}")
    return share


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=core.ROOT / "build" / "coverage")
    parser.add_argument("--bound", type=float, default=95.0, help="share in percent under which it ends with 1")
    parser.add_argument("--missing", action="store_true", help="also lists the lines with branches that were not taken")
    parser.add_argument("--no-build", action="store_true")
    parser.add_argument("--no-run", action="store_true", help="reads what an earlier run counted")
    parser.add_argument("--only", help="runs these tests, and adds to what an earlier run counted")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    build = options.build.resolve()
    tests = options.only.split(",") if options.only else list(core.TESTS)
    if not options.no_build:
        core.configure(build, "coverage", "--coverage")
        core.make(build, tests, options.jobs)
    if not options.no_run:
        if not options.only:
            for counted in build.rglob("*.gcda"):
                counted.unlink()
        for test in tests:
            ended = core.run_niced([build / "bin" / test, "--gtest_brief=1", f"--gtest_filter={core.TESTS[test]}"],
                                   stdout=sys.stderr)
            if ended.returncode:
                sys.exit(f"{test} failed")
    print("branches of", ", ".join(tests) if options.only else "all tests of the core")
    share = report(read_counts(sorted(build.rglob("*.gcno")), core.ROOT, set(core.files())), core.files(), options.missing,
                   core.ROOT)
    return 0 if share >= options.bound else 1


if __name__ == "__main__":
    sys.exit(main())
