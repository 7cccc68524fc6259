#!/usr/bin/python3
"""Changes one operator of the safety core at a time, and counts which changes its unit tests notice.

    mutants.py build [--build FOLDER]
    mutants.py run [--sample N] [--seed S] [--seconds S] [--bound SHARE] [--at-once N] [--only ID,...]
    mutants.py list

`build` compiles all mutants (mutate.py) into one build, build/mutants, and runs each case of the tests that core.py names once,
which tells what each reaches. `run` draws mutants, chooses each by SIDESTEP_MUTANT, and runs the cases that reach it, the
quickest first, until one fails, crashes or hangs: the mutant is killed. What was run is kept in build/mutants/core/results.csv;
another `run` goes on from there. It ends with 1 where fewer of those drawn were killed than the bound (95 %) says.
equivalent.txt lists survivors that no test could tell from the source, with the reason: they are left out of the share.
Needs python3-clang-14.
"""

import argparse
import collections
import concurrent.futures
import csv
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

sys.dont_write_bytecode = True

import core

QUICK_S = 2.0  # Cases are run together up to so many seconds: a failure ends the run of those.


def arguments_of(command):
    """What clang needs to know of how a source is compiled."""
    words = command.split()
    kept = []
    for i, word in enumerate(words):
        if word in ("-isystem", "-I", "-D"):
            kept += words[i:i + 2]
        elif re.match(r"-(I|D|std=)", word):
            kept.append(word.replace('\\"', '"'))
    return kept


def write_source(build, place, command, left_out):
    """Writes the copy of a source; returns its mutants: [(id, file, line, kind, before, after)]."""
    from mutate import Mutated
    source = core.sources()[place]
    mutated = Mutated(str(core.ROOT / source), arguments_of(command), place * 1000, left_out)
    for error in mutated.errors:  # what clang 14 does not know of C++20: nothing is changed there
        print(error, file=sys.stderr)
    copy = build / "core" / "sources" / source
    copy.parent.mkdir(parents=True, exist_ok=True)
    text = mutated.source()
    if not copy.exists() or copy.read_bytes() != text:
        copy.write_bytes(text)
    return [(place * 1000 + i, source, *mutant) for i, mutant in enumerate(mutated.mutants)]


def write_table(path, rows):
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows(rows)


def read_table(path):
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.reader(file))


class Process:
    """Runs a program with a mutant in a session of its own."""

    def __init__(self, words, limit_s, environment):
        begin = time.monotonic()
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   env={**os.environ, **environment}, start_new_session=True,
                                   preexec_fn=lambda: os.nice(10))
        self.is_hanging = False

        def kill():
            self.is_hanging = True
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(limit_s, kill)
        timer.start()
        self.out = process.communicate()[0].decode(errors="replace")
        timer.cancel()
        self.code, self.took_s = process.returncode, time.monotonic() - begin

    def verdict(self):
        if self.is_hanging:
            return "hangs"
        failed = re.search(r"\[  FAILED  \] (\S+?)(,| \()", self.out)
        return failed[1] if failed else f"ends with {self.code}"


def cases_of(program, wanted):
    """The cases of a program of tests."""
    out = subprocess.run([program, "--gtest_list_tests", f"--gtest_filter={wanted}"], capture_output=True, text=True,
                         check=True).stdout
    cases, suite = [], ""
    for line in out.splitlines():
        name = line.split("#")[0]
        if re.match(r"\S+\.\s*$", name):
            suite = name.strip()
        elif re.match(r"  \S", name) and suite and "DISABLED_" not in suite + name:
            cases.append(suite + name.strip())
    return cases


def look_at_cases(build, at_once, tests):
    """Runs each case without a mutant: (program, case, seconds, mutants that it reaches)."""
    def look(job):
        test, case = job
        with tempfile.NamedTemporaryFile() as reached:
            ended = Process([str(build / "bin" / test), f"--gtest_filter={case}", "--gtest_brief=1"], 900.0,
                            {"SIDESTEP_REACHED": reached.name, "SIDESTEP_MUTANT": "-1"})
            if ended.code:
                print(f"{test} {case} fails without a mutant and is left out", file=sys.stderr)
                return None
            ids = sorted({int(line) for line in pathlib.Path(reached.name).read_text().split()})
            return test, case, f"{ended.took_s:.3f}", " ".join(map(str, ids))

    jobs = [(test, case) for test, wanted in tests.items() for case in cases_of(build / "bin" / test, wanted)]
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        return [row for row in pool.map(look, jobs) if row]


def batches(cases):
    """Cases of one program each, the quickest first, together up to some seconds: [(program, cases, seconds)]."""
    groups = []
    for test, case, took_s in sorted(cases, key=lambda each: each[2]):
        group = next((one for one in groups if one[0] == test and one[2] + took_s <= QUICK_S and len(one[1]) < 200), None)
        if group is None:
            groups.append([test, [case], took_s])
        else:
            group[1].append(case)
            group[2] += took_s
    return sorted(groups, key=lambda group: group[2])


def try_mutant(build, number, cases):
    """(verdict, seconds): "" of one that no test noticed."""
    begin = time.monotonic()
    for test, names, took_s in batches(cases):
        ended = Process([str(build / "bin" / test), f"--gtest_filter={':'.join(names)}", "--gtest_fail_fast"],
                        20.0 + 10.0 * took_s, {"SIDESTEP_MUTANT": str(number)})
        if ended.code or ended.is_hanging:
            return ended.verdict(), time.monotonic() - begin
    return "", time.monotonic() - begin


def key_of(mutant):
    """What names a mutant whatever else is changed: file, its line's mutants of that kind, before and after."""
    _, source, line, kind, before, after = mutant
    return source, kind, before, after


def equivalents():
    """{(file, before, after)}: of equivalent.txt, whose lines are `FILE | BEFORE | AFTER | REASON`."""
    listed = set()
    for line in (core.HERE / "equivalent.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            listed.add(tuple(part.strip() for part in line.split(" | ")[:3]))
    return listed


def command_build(build, options):
    core.configure(build, "mutants")
    commands = {entry["file"]: entry["command"] for entry in json.loads((build / "compile_commands.json").read_text())}
    places = [place for place, source in enumerate(core.sources()) if str(core.ROOT / source) in commands]
    left_out, mutants = collections.defaultdict(set), {}
    for _ in range(8):
        with concurrent.futures.ProcessPoolExecutor(options.at_once) as pool:
            jobs = {place: pool.submit(write_source, build, place, commands[str(core.ROOT / core.sources()[place])],
                                       left_out[core.sources()[place]]) for place in places}
            mutants.update({place: job.result() for place, job in jobs.items()})
        ended = subprocess.run(["ninja", "-C", build, f"-j{options.jobs}", "-k0", *core.TESTS], capture_output=True, text=True)
        if not ended.returncode:
            break
        # What does not compile is no mutant: none is made of lines with an error.
        errors = set(re.findall(r"core/sources/(\S+?\.cpp):(\d+):\d+:\s+(?:error|required from here)", ended.stdout))
        if not errors:
            sys.exit(ended.stdout[-4000:])
        for source, line in sorted(errors):
            print(f"{source}:{line}: left out, for it does not compile", file=sys.stderr)
            left_out[source].add(int(line))
        places = sorted({core.sources().index(source) for source, _ in errors})
    else:
        sys.exit("the mutants do not compile")
    rows = [row for _, of_source in sorted(mutants.items()) for row in of_source]
    write_table(build / "core" / "mutants.csv", rows)
    write_table(build / "core" / "cases.csv", look_at_cases(build, options.at_once, core.TESTS))
    print(f"{len(rows)} mutants")
    return 0


def command_run(build, options):
    mutants = {int(row[0]): row for row in read_table(build / "core" / "mutants.csv")}
    reaching = collections.defaultdict(list)
    for test, case, took_s, ids in read_table(build / "core" / "cases.csv"):
        for number in ids.split():
            reaching[int(number)].append((test, case, float(took_s)))
    drawn = sorted(mutants)
    random.Random(options.seed).shuffle(drawn)
    if options.only:
        drawn = [int(number) for number in options.only.split(",")]
    elif options.sample:
        drawn = drawn[:options.sample]
    results = build / "core" / "results.csv"
    done = {} if options.again else {int(row[0]): row for row in read_table(results)}
    lock = threading.Lock()
    until = time.monotonic() + (options.seconds or 1e9)

    def try_one(number):
        if number in done or time.monotonic() > until:
            return
        verdict, took_s = try_mutant(build, number, reaching[number])
        row = [number, "killed" if verdict else "survived" if reaching[number] else "not reached", verdict, f"{took_s:.1f}"]
        with lock:
            done[number] = row
            with open(results, "a", newline="") as file:
                csv.writer(file).writerow(row)
            _, source, line, _, before, after = mutants[number]
            print(f"{row[1]} {number} {source}:{line}: {before} -> {after or 'nothing'}"
                  + (f"  [{verdict}]" if verdict else ""), flush=True)

    with concurrent.futures.ThreadPoolExecutor(options.at_once) as pool:
        list(pool.map(try_one, drawn))
    return summarise(mutants, {number: done[number] for number in drawn if number in done}, options.bound)


def summarise(mutants, done, bound):
    listed = equivalents()
    counts = collections.defaultdict(collections.Counter)
    for number, row in done.items():
        _, source, _, kind, before, after = mutants[number]
        verdict = "killed" if row[1] == "killed" else "equivalent" if (source, before, after) in listed else row[1]
        for name in (source, "all"):
            counts[name][verdict] += 1
    print(f"\n{'mutants':>8} {'killed':>7} {'survived':>9} {'not reached':>12} {'equivalent':>11} {'share':>7}  file")
    share = 0.0
    for name in [*sorted(set(counts) - {"all"}), "all"]:
        of_file = counts[name]
        telling = sum(of_file.values()) - of_file["equivalent"]
        share = 100.0 * of_file["killed"] / telling if telling else 0.0
        print(f"{sum(of_file.values()):8} {of_file['killed']:7} {of_file['survived']:9} {of_file['not reached']:12} "
              f"{of_file['equivalent']:11} {share:6.1f}%  {name}")
    return 0 if share >= bound else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("build", "run", "list"))
    parser.add_argument("--build", type=pathlib.Path, default=core.ROOT / "build" / "mutants")
    parser.add_argument("--sample", type=int, help="so many, drawn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="numbers of mutants")
    parser.add_argument("--again", action="store_true", help="also those with a result")
    parser.add_argument("--seconds", type=float, help="after which nothing more is begun")
    parser.add_argument("--bound", type=float, default=95.0, help="share in percent under which it ends with 1")
    parser.add_argument("--at-once", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    build = options.build.resolve()
    if options.command == "build":
        return command_build(build, options)
    if options.command == "list":
        for number, source, line, kind, before, after in read_table(build / "core" / "mutants.csv"):
            print(f"{number} {source}:{line}: {before} -> {after or 'nothing'}")
        return 0
    return command_run(build, options)


if __name__ == "__main__":
    sys.exit(main())
