"""Where the token might be left: in files, in command lines, in environments."""

import os
import pathlib
import time

from bench import expect


def with_bytes(files, needle):
    found = []
    for file in files:
        try:
            if needle in pathlib.Path(file).read_bytes():
                found.append(str(file))
        except OSError:
            pass
    return found


def in_files(bench, _):
    """No file of a run holds its token; its own output tells it once, to who has begun it."""
    searched = 0
    for target in bench.targets:
        if not target.token:
            continue
        target.wait()
        files = [f for f in target.out.rglob("*") if f.is_file()]
        searched += len(files)
        found = with_bytes(files, target.token.encode())
        expect(not found, f"the token is in {' '.join(found)}")
        expect(target.said[target.process.stdout].count(target.token) == 0, "the token is in what is printed")
        expect(target.said[target.process.stderr].count(target.token) == 1, "the token is told more than once")
    return f"{searched} files of {len(bench.targets)} runs"


def in_processes(bench, _):
    """Nobody who lists processes sees the token, even where a browser is opened."""
    folder = bench.work / "browser"
    folder.mkdir(exist_ok=True)
    asked = folder / "asked"
    asked.unlink(missing_ok=True)
    (folder / "xdg-open").write_text(f"#!/bin/sh\nprintf '%s' \"$1\" > '{asked}.new' && mv '{asked}.new' '{asked}'\nexec sleep 5\n")
    (folder / "xdg-open").chmod(0o755)
    target = bench.begin("--view", "--view-bind", "127.0.0.1", "--open", path=f"{folder}:{os.environ['PATH']}")
    bench.targets.append(target)
    until = time.monotonic() + 20
    while not asked.exists() and time.monotonic() < until:
        time.sleep(0.05)
    expect(asked.exists(), "no browser is asked")
    own = {os.getpid(), os.getppid()}
    processes = [p for p in pathlib.Path("/proc").glob("[0-9]*") if int(p.name) not in own]
    found = with_bytes([p / "cmdline" for p in processes] + [p / "environ" for p in processes], target.token.encode())
    shown = asked.read_text()
    target.page_gets_in(30.0)  # the run waits for it
    expect(not found, f"the token is in {' '.join(found)}")
    expect(target.token not in shown, "the token is in the browser's command line")
    return f"{len(processes)} processes"


TRACES = [in_processes, in_files]
