"""Runs a command, and reads what it left in the folder of its run."""

import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import threading
import time

CRASH = re.compile(r"crashed \(|aborted \(|killed by SIGKILL|ended the process with|terminate called|AddressSanitizer|"
                   r"Aborted|core dumped|free\(\): |malloc\(\): |double free|corrupt(ed|ion)|std::terminate")
# What may differ between two runs of one configuration: times, and who ran it.
TIMES = re.compile(r"(_ms|_s|_us|_hz|wall|cpu|time|ratio|threads)\b|session|provenance|memory|dropped|map_age|answers"
                   r"|spent|first_valid|episode.mapping")


class Ended:
    """How a process ended."""

    def __init__(self, code, out, err, took_s, timed_out):
        self.code, self.out, self.err, self.took_s, self.timed_out = code, out, err, took_s, timed_out

    def message(self):
        """The last line that tells an error, or the last one that is no mere progress."""
        lines = [re.sub(r"^info: \d+/\d+ ", "", line) for line in self.err.splitlines()]  # of a job
        lines = [line for line in lines if line.strip() and not line.startswith(("info: ", "warning: "))]
        errors = [line for line in lines if line.startswith("error: ")]
        return (errors or lines or [""])[-1]


class Page(threading.Thread):
    """A page of the viewer: fetches it, opens its socket and reads what comes."""

    def __init__(self, url):
        super().__init__(daemon=True)
        self.url = url

    def run(self):
        at = re.match(r"http://([^:/]+):(\d+)(/\S*)", self.url)
        if not at:
            return
        host, port = at[1], int(at[2])
        for request in ("GET / HTTP/1.1\r\nHost: %s:%d\r\n\r\n",
                        "GET /live HTTP/1.1\r\nHost: %s:%d\r\nOrigin: http://%s:%d\r\nUpgrade: websocket\r\n"
                        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"):
            try:
                with socket.create_connection((host, port), timeout=10) as connection:
                    connection.sendall((request % ((host, port) * (request.count("%s")))).encode())
                    while connection.recv(65536):
                        pass
            except OSError:
                pass


def run(words, environment=None, limit_s=60.0, folder=None, view=False, limits=None, stdout=None, shell_prefix=()):
    """Runs a command in a session of its own; what is left of it after the limit is killed."""
    begin = time.monotonic()
    process = subprocess.Popen([*shell_prefix, *map(str, words)], stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE if stdout is None else stdout, stderr=subprocess.PIPE,
                               env={**os.environ, "LC_ALL": "C", **(environment or {})}, cwd=folder, preexec_fn=limits,
                               start_new_session=True)
    timed_out = False
    err = []

    def read_err():
        for line in process.stderr:
            err.append(line.decode(errors="replace"))
            if view and "http://" in err[-1]:
                Page(re.search(r"http://\S+", err[-1])[0]).start()

    reader = threading.Thread(target=read_err, daemon=True)
    reader.start()
    timer = threading.Timer(limit_s, lambda: os.killpg(process.pid, signal.SIGKILL))
    timer.start()
    out = b""
    if process.stdout is not None:
        for line in process.stdout:
            out += line
            if view and b"http://" in line:
                Page(re.search(r"http://\S+", line.decode())[0]).start()
    code = process.wait()
    timed_out = time.monotonic() - begin >= limit_s
    timer.cancel()
    reader.join(5)
    try:
        os.killpg(process.pid, signal.SIGKILL)  # e.g. a job that outlived a killed parent for a moment
    except ProcessLookupError:
        pass
    return Ended(code, out.decode(errors="replace"), "".join(err), time.monotonic() - begin, timed_out)


def rows_of(folder, scratch):
    """Every measurement and array of a run's store, read from a copy of it; None where there is none."""
    files = [folder / ("results.sqlite" + suffix) for suffix in ("", "-wal", "-journal")]
    if not files[0].exists() or files[0].stat().st_size == 0:
        return None
    scratch.mkdir(parents=True, exist_ok=True)
    for file in files:
        (scratch / file.name).unlink(missing_ok=True)
        if file.exists():
            shutil.copyfile(file, scratch / file.name)
    database = sqlite3.connect(scratch / "results.sqlite")
    try:
        whole = database.execute("PRAGMA integrity_check").fetchone()[0]
        if whole != "ok":
            raise sqlite3.DatabaseError("integrity_check: " + whole)
        tables = {name for name, in database.execute("SELECT name FROM sqlite_master")}
        if not tables >= {"provenance", "measurements", "arrays"}:
            return None  # ended before anything was saved
        rows = {(s, i, k): v for s, i, k, v in database.execute("SELECT * FROM measurements")}
        rows.update({(s, i, k): (r, c, b) for s, i, k, r, c, b in database.execute("SELECT * FROM arrays")})
        return rows
    finally:
        database.close()


def leaves(value, path=""):
    """The values of a summary by their paths."""
    if isinstance(value, dict):
        return {p: v for key, one in value.items() for p, v in leaves(one, path + "/" + key).items()}
    if isinstance(value, list):
        return {p: v for i, one in enumerate(value) for p, v in leaves(one, f"{path}/{i}").items()}
    return {path: value}


def settled(summary):
    return {path: value for path, value in leaves(summary).items()
            if not TIMES.search(path.replace("/", ".")) and path not in ("/verdict", "/configuration")}


def settled_rows(rows):
    return {at: value for at, value in rows.items() if not TIMES.search(at[0] + "." + at[2])}


def first_difference(one, other):
    for at in sorted(set(one) | set(other), key=str):
        if one.get(at, "nothing") != other.get(at, "nothing"):
            return f"{at}: {str(one.get(at, 'nothing'))[:80]} instead of {str(other.get(at, 'nothing'))[:80]}"
    return ""


class Outcome:
    """What a run left in its folder."""

    def __init__(self, folder, scratch):
        self.files = {str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file()} if folder.exists() else set()
        summary = folder / "summary.json"
        self.summary = json.loads(summary.read_text()) if summary.exists() else None
        self.rows = rows_of(folder, scratch)
        page = folder / "report.html"
        self.page_is_whole = not page.exists() or page.read_text(errors="replace").rstrip().endswith("</html>")


def lasting(files):
    return {f for f in files if not f.endswith((".sqlite-wal", ".sqlite-shm"))}


def incomplete(outcome, reference, exact):
    """What a success lacks of the undisturbed run's results; empty where nothing."""
    if lasting(outcome.files) != lasting(reference.files) and exact:
        return "files differ: " + " ".join(sorted(lasting(outcome.files) ^ lasting(reference.files)))
    if (outcome.summary is None) != (reference.summary is None):
        return "summary.json is missing"
    if not outcome.page_is_whole:
        return "report.html is cut off"
    if outcome.summary is not None and outcome.summary.get("success") is not True:
        return "exit code 0, but summary.json says no success"
    if not exact:
        return ""
    if reference.summary is not None:
        difference = first_difference(settled(outcome.summary), settled(reference.summary))
        if difference:
            return "the summary differs: " + difference
    if reference.rows is not None:
        if outcome.rows is None:
            return "results.sqlite is empty"
        difference = first_difference(settled_rows(outcome.rows), settled_rows(reference.rows))
        if difference:
            return "the results differ: " + difference
    return ""
