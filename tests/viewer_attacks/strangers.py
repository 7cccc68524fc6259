"""Attacks by those who have no token. Each takes a bench and says what it did; what does not hold it raises."""

import itertools
import os
import random
import threading
import time

from bench import MOST_CONNECTIONS, SECRET, expect, limit_files
from wire import PING, TEXT, Line, answers_in, frame, upgrade

REQUEST_TIME_S = 5.0  # what docs/reference/viewer.md allows a request
SLACK_S = 10.0  # of a busy machine


class Crowd:
    """Connections that are opened again as often as they are ended, until the crowd disperses."""

    def __init__(self, target, count, act, buffer_bytes=None, workers=4):
        self.target, self.act, self.buffer_bytes = target, act, buffer_bytes
        self.opened, self.lasted_s, self.over = 0, [], threading.Event()
        self.threads = [threading.Thread(target=self._stand, args=(count // workers,), daemon=True) for _ in range(workers)]
        for thread in self.threads:
            thread.start()

    def _stand(self, count):
        lines = [None] * count
        while not self.over.is_set() and self.target.alive():
            for i, line in enumerate(lines):
                try:
                    if line is None:
                        line = lines[i] = self.target.stranger(buffer_bytes=self.buffer_bytes, patience_s=5.0)
                        self.opened += 1
                        line.socket.setblocking(False)
                        line.rounds, line.begun = 0, time.monotonic()
                    if self.act(line) is False:
                        self.lasted_s.append(time.monotonic() - line.begun)
                        line.close()
                        lines[i] = None
                except OSError:
                    if line is not None:
                        line.close()
                    lines[i] = None
                if self.over.is_set():
                    break
            time.sleep(0.03)
        for line in filter(None, lines):
            line.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.over.set()
        for thread in self.threads:
            thread.join(30)


def is_over(line):
    """Whether the other side has ended the connection; takes what it said."""
    return line.more() == b""


def wait_silently(line):
    return not is_over(line)


def drip(line):
    """A byte of a header now and then."""
    line.rounds += 1
    if line.rounds % 10 == 1 and not line.send("GET / HTTP/1.1\r\nX: " if line.rounds == 1 else "x"):
        return False
    return not is_over(line)


def ask_slowly(line):
    """Asks for the largest file, and reads a byte of it now and then."""
    line.rounds += 1
    if line.rounds == 1:
        return line.send(f"GET /viewer.js HTTP/1.1\r\nHost: {line.host}\r\n\r\n")
    if line.rounds % 50 == 0:
        byte = line.socket.recv(1)
        if line.heard:
            line.heard(byte)
        return byte != b""
    return True


def pages_get_in(target, crowd, seconds):
    """The longest that one of several pages took beside a crowd."""
    until, longest, count = time.monotonic() + seconds, 0.0, 0
    time.sleep(min(1.0, seconds / 4))  # the crowd is there
    while count == 0 or time.monotonic() < until:
        longest, count = max(longest, target.page_gets_in()), count + 1
    return f"{crowd.opened} connections; {count} pages got in, the slowest in {longest:.2f} s"


def idle_connections(bench, scale):
    """500 connections that say nothing, and come again as often as they are ended."""
    target = bench.target()
    before = target.most_files
    with Crowd(target, 500, wait_silently) as crowd:
        told = pages_get_in(target, crowd, 8.0 * scale)
    expect(target.most_files <= before + MOST_CONNECTIONS + 8, f"{target.most_files} files are open")
    return told + f"; at most {target.most_files} files open"


def few_descriptors(bench, _):
    """The same where a process may have 96 files open: a run saves what it has."""
    target = bench.begin("--view", "--view-bind", "127.0.0.1", limits=limit_files(96))
    bench.targets.append(target)
    with Crowd(target, 500, wait_silently) as crowd:
        code = target.wait()
    expect(crowd.opened >= 500, f"only {crowd.opened} connections")
    return f"{crowd.opened} connections, at most {target.most_files} files open, exit code {code}"


def slow_headers(bench, scale):
    """Requests that go on for ever: a byte at a time, 100 of them, so that none has to give way."""
    target = bench.target()
    with Crowd(target, 100, drip) as crowd:
        told = pages_get_in(target, crowd, REQUEST_TIME_S + 3.0 * scale)
        until = time.monotonic() + SLACK_S
        while not crowd.lasted_s and time.monotonic() < until:
            time.sleep(0.05)
    expect(crowd.lasted_s, f"no request is ended within {REQUEST_TIME_S + SLACK_S:.0f} s")
    expect(max(crowd.lasted_s) <= REQUEST_TIME_S + SLACK_S, f"a request was read for {max(crowd.lasted_s):.1f} s")
    return told + f"; requests were read for {max(crowd.lasted_s):.1f} s at most"


def slow_readers(bench, scale):
    """300 who ask for the largest file, with the smallest window there is, and read nothing or a byte at a time."""
    target = bench.target()
    with Crowd(target, 300, ask_slowly, buffer_bytes=1) as crowd:
        return pages_get_in(target, crowd, 8.0 * scale)


def storm(bench, scale):
    """Connections that are reset, closed or closed by half: before a request, amid one, after one."""
    target = bench.target()
    request = f"GET /viewer.js HTTP/1.1\r\nHost: 127.0.0.1:{target.port}\r\n\r\n"
    begun = itertools.cycle([b"", request[:20].encode(), request.encode(), upgrade("x", "/socket").encode(), b"\x81"])
    ends = itertools.cycle(["reset", "close", "half"])
    count, until, longest = 0, time.monotonic() + 6.0 * scale, 0.0
    while time.monotonic() < until:
        for _ in range(100):
            line = target.stranger(patience_s=5.0)
            line.send(next(begun))
            count += 1
            match next(ends):
                case "reset":
                    line.reset()
                case "close":
                    line.close()
                case "half":
                    line.socket.shutdown(1)
                    line.close()
        longest = max(longest, target.page_gets_in())
    return f"{count} connections; pages got in in {longest:.2f} s at most"


def half_open(bench, _):
    """Who says no more after a request is answered; who says no more amid one is heard no longer than allowed."""
    target = bench.target()
    with target.stranger() as whole, target.stranger() as broken, target.stranger() as silent:
        whole.send(f"GET /viewer.css HTTP/1.1\r\nHost: {whole.host}\r\n\r\n")
        whole.socket.shutdown(1)
        broken.send("GET /viewer.css HTTP/1.1\r\nHo")
        broken.socket.shutdown(1)
        begin = time.monotonic()
        answers = answers_in(whole.all(SLACK_S)[0])
        expect(len(answers) == 1 and answers[0].status in (200, 404), "a request whose sender is done is not answered")
        for line in (broken, silent):
            expect(line.all(REQUEST_TIME_S + SLACK_S)[1], "a connection that says nothing is not ended")
    return f"ended within {time.monotonic() - begin:.1f} s"


def giant_headers(bench, _):
    """Requests that are too long in every part, with an end and without."""
    target, host = bench.target(), f"Host: 127.0.0.1:{bench.target().port}\r\n"
    head = f"GET / HTTP/1.1\r\n{host}"
    long = {"target": f"GET /{'a' * 1_000_000} HTTP/1.1\r\n{host}\r\n", "field": f"{head}X: {'a' * 1_000_000}\r\n\r\n",
            "name": f"{head}{'X' * 1_000_000}: a\r\n\r\n", "fields": head + "X: a\r\n" * 100_000 + "\r\n",
            "method": "A" * 1_000_000, "lines": "\r\n" * 500_000, "host": "GET / HTTP/1.1\r\nHost: " + "a" * 1_000_000,
            "cookie": f"{head}Cookie: token={'0' * 100_000}\r\n\r\n"}
    for what, request in long.items():
        with target.stranger() as line:
            line.send(request)
            received, is_ended = line.all(REQUEST_TIME_S + SLACK_S)
            expect(is_ended, f"an endless {what} is read on")
            statuses = [a.status for a in answers_in(received)]
            expect(statuses in ([], [400], [431]), f"a long {what} is answered {statuses}")
    with target.stranger() as line:
        sent = 0
        while line.send(b"GET / HTTP/1.1\r\nX: " if sent == 0 else b"b" * 65536):
            sent += 65536
            expect(sent < 64 << 20, "64 MiB of a header are taken")
    return f"{len(long) + 1} requests; {sent >> 10} KiB of an endless one were taken"


def smuggling(bench, _):
    """Requests whose end or target is told in two ways; what hides behind them must not be answered."""
    target = bench.target()
    host = f"127.0.0.1:{target.port}"
    hidden = f"GET /{target.query} HTTP/1.1\r\nHost: {host}\r\n\r\n"  # with the right token
    page = f"GET /viewer.css HTTP/1.1\r\nHost: {host}\r\n"
    requests = {
        "pipelined": f"{page}\r\n{hidden}",
        "keep-alive": f"{page}Connection: keep-alive\r\n\r\n{hidden}{hidden}",
        "length and chunks": f"{page}Content-Length: {len(hidden) + 5}\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n{hidden}",
        "chunks and length": f"{page}Transfer-Encoding: chunked\r\nContent-Length: 4\r\n\r\n0\r\n\r\n{hidden}",
        "two lengths": f"{page}Content-Length: 0\r\nContent-Length: {len(hidden)}\r\n\r\n{hidden}",
        "list of lengths": f"{page}Content-Length: 0, {len(hidden)}\r\n\r\n{hidden}",
        "signed length": f"{page}Content-Length: +0\r\n\r\n{hidden}", "negative length": f"{page}Content-Length: -1\r\n\r\n{hidden}",
        "giant length": f"{page}Content-Length: 18446744073709551616\r\n\r\n{hidden}",
        "hexadecimal length": f"{page}Content-Length: 0x0\r\n\r\n{hidden}",
        "unknown coding": f"{page}Transfer-Encoding: xchunked\r\n\r\n0\r\n\r\n{hidden}",
        "coding, then chunks": f"{page}Transfer-Encoding: identity, chunked\r\n\r\n0\r\n\r\n{hidden}",
        "tab before chunks": f"{page}Transfer-Encoding:\tchunked\r\n\r\n0\r\n\r\n{hidden}",
        "blank before colon": f"{page}Transfer-Encoding : chunked\r\n\r\n0\r\n\r\n{hidden}",
        "bare line feeds": page.replace("\r\n", "\n") + "\n" + hidden, "bare returns": page.replace("\r\n", "\r") + "\r" + hidden,
        "folded": f"GET /viewer.css HTTP/1.1\r\nHost: {host}\r\nX: a\r\n b\r\n\r\n{hidden}",
        "folded chunks": f"{page}X: a\r\n Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n{hidden}",
        "folded host": f"GET /viewer.css HTTP/1.1\r\nHost:\r\n {host}\r\n\r\n{hidden}",
        "zero in a field": f"{page}X: a\0b\r\n\r\n{hidden}", "zero in a name": f"{page}X\0: a\r\n\r\n{hidden}",
        "absolute": f"GET http://{host}/{target.query} HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        "absolute, of others": f"GET http://evil.example/ HTTP/1.1\r\nHost: {host}\r\n\r\n",
        "authority": f"GET {host} HTTP/1.1\r\nHost: {host}\r\n\r\n", "asterisk": f"OPTIONS * HTTP/1.1\r\nHost: {host}\r\n\r\n",
        "two blanks": f"GET  /{target.query} HTTP/1.1\r\nHost: {host}\r\n\r\n", "no version": f"GET /{target.query}\r\n\r\n",
        "HTTP/1.0": f"GET /{target.query} HTTP/1.0\r\n\r\n", "HTTP/3.7": f"GET /{target.query} HTTP/3.7\r\nHost: {host}\r\n\r\n",
        "HTTP/2": "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + "\0\0\0\4\0\0\0\0\0", "expecting": f"{page}Expect: 100-continue\r\n\r\n{hidden}",
        "h2c": f"{page}Upgrade: h2c\r\nConnection: Upgrade, HTTP2-Settings\r\nHTTP2-Settings: AAMAAABk\r\n\r\n{hidden}",
        "frames at once": upgrade(host, "/socket" + target.query) + frame(TEXT, '{"slice":null}').decode("latin-1") + hidden,
        "response in host": f"GET / HTTP/1.1\r\nHost: {host}\r\n\tX\r\n\r\n",
    }
    for what, request in requests.items():
        with target.stranger() as line:
            line.send(request)
            received, is_ended = line.all(REQUEST_TIME_S + SLACK_S)
            answers = answers_in(received)
            expect(is_ended, f"{what}: the connection goes on")
            expect(len(answers) <= 1, f"{what}: answered {[a.status for a in answers]}")
            is_page = answers and answers[0].status == 200 and answers[0].body not in bench.assets
            expect(not is_page, f"{what}: the page is served")
    return f"{len(requests)} requests, each answered at most once"


def traversal(bench, _):
    """Paths out of the page, in all spellings, and by links in it."""
    target = bench.target()
    out = [bench.prefix / "share/sidestep/secret.txt", target.out / "run.log", "/etc/passwd", "/proc/self/environ"]
    ups = ["../", "..%2f", "%2e%2e/", "%2e%2e%2f", "..%5c", "..\\", "%252e%252e%252f", "..%c0%af", "%uff0e%uff0e/", "..;/", ".../",
           "....//", "%2e./", "./../", "..%00/", "..%2f..%2f", "/viewer.js/../", "parts/../../"]
    paths = [f"/{up * n}secret.txt" for up in ups for n in (1, 3)] + [f"/{up * 12}etc/passwd" for up in ups]
    paths += [str(path) for path in out] + [f"//{path}" for path in out] + [f"file://{path}" for path in out]
    paths += ["/link.txt", "/up", "/up/share/sidestep/secret.txt", "/viewer.js%00.html", "/viewer.js\0.html", "/index.html%00.js",
              "/viewer.js?../../secret.txt", "/~root", "/.", "/..", "/?", "/#", "/;", "/index.html/", "/INDEX.HTML", "/spheres.html",
              "/%69ndex.html", "/./index.html", "//index.html", "/index%2ehtml", "/ind\u00e9x.html", "C:\\secret.txt"]
    for path in paths:
        with target.stranger() as line:
            answers = line.get(path, limit_s=REQUEST_TIME_S + SLACK_S)
            expect(len(answers) == 1, f"{path}: {len(answers)} answers")
            if answers[0].status == 200:
                expect(path.startswith("/viewer.js?"), f"{path} is served")
        with Line(target.port) as line:  # and with the token
            answers = line.get(path + target.query, limit_s=REQUEST_TIME_S + SLACK_S)
            expect(not any(SECRET in a.body or b"root:" in a.body for a in answers), f"{path} with the token leads out")
    return f"{len(paths)} paths"


def methods(bench, _):
    """Other methods than GET, with the token and a body or without."""
    target = bench.target()
    names = ["POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH", "PROPFIND", "SUBSCRIBE", "M-SEARCH", "get", "GETS", "", "\0"]
    for name, body in itertools.product(names, ("", "Content-Length: 4\r\n\r\nstop")):
        for path in (f"/{target.query}", f"/socket{target.query}"):
            with target.stranger() as line:
                mark = "X-Mark: 8f31c0\r\n"
                answers = line.get(path, mark + body, method=name, limit_s=REQUEST_TIME_S + SLACK_S)
                expect(len(answers) <= 1, f"{name}: {len(answers)} answers")
                for answer in answers:
                    expect(answer.status in (400, 405, 413), f"{name}: answered {answer.status}")
                    expect(b"8f31c0" not in answer.body, f"{name}: the request is told back")
    return f"{2 * len(names)} methods and bodies"


def host_and_origin(bench, _):
    """Pages of other sites, and names that an attacker's DNS makes point here: none is served, token or not."""
    target = bench.target()
    port = target.port
    hosts = ["", "evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", f"127.0.0.2:{port}", f"127.1:{port}",
             f"2130706433:{port}", f"0x7f.1:{port}", f"[::1]:{port}", f"0.0.0.0:{port}", f"127.0.0.1.:{port}", f"localhost.:{port}",
             f"127.0.0.1.evil.example:{port}", f"localhost.evil.example:{port}", f"evil.example@127.0.0.1:{port}",
             f"127.0.0.1:{port}@evil.example", f"127.0.0.1:{port}, evil.example", f"evil.example, 127.0.0.1:{port}",
             f"127.0.0.1:{port}/", f"127.0.0.1:{port} evil", f"127.0.0.1:0{port}", f"127.0.0.1:{port}:{port}", f"x127.0.0.1:{port}",
             f"127.0.0.1\t:{port}", f"[127.0.0.1:{port}", os.uname().nodename + f":{port}", "x'; script-src *"]
    origins = ["", "null", "http://evil.example", f"http://evil.example:{port}", f"https://127.0.0.1:{port}", "http://127.0.0.1",
               f"http://localhost:{port}", f"http://127.0.0.1:{port}.evil.example", f"http://127.0.0.1:{port}/", "file://",
               f"http://127.0.0.1:{port} http://evil.example", f"ws://127.0.0.1:{port}", f"http://127.0.0.1:{port + 1}", "chrome-extension://x"]
    own = f"Host: 127.0.0.1:{port}\r\n"
    with Line(port) as line:
        expect(line.ask_for_socket(f"/socket{target.query}", f"Origin: http://127.0.0.1:{port}\r\n") == 101, "its own page is refused")
    for query in ("", target.query):
        for fields in [f"Host: {host}\r\n" for host in hosts] + ["", own + own, own + "Host: evil.example\r\n", "Host: evil.example\r\n" + own,
                                                                f"X-Forwarded-Host: 127.0.0.1:{port}\r\n"]:
            for path in ("/", "/viewer.js", "/socket"):
                with target.stranger() as line:
                    up = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: " \
                         "dGhlIHNhbXBsZSBub25jZQ==\r\n" if path == "/socket" else ""
                    line.send(f"GET {path}{query} HTTP/1.1\r\n{fields}{up}\r\n")
                    statuses = [a.status for a in answers_in(line.all(REQUEST_TIME_S + SLACK_S)[0])]
                    expect(statuses in ([403], [400]), f"{path} of '{fields.strip()}' is answered {statuses}")
        for origin in origins + [f"http://127.0.0.1:{port}\r\nOrigin: http://evil.example"]:
            with target.stranger() as line:
                status = line.ask_for_socket(f"/socket{query}", f"Origin: {origin}\r\n")
                expect(status == 403, f"the socket of origin '{origin}' is answered {status}")
    return f"{len(hosts) + 5} hosts and {len(origins) + 1} origins, each without the token and with it"


def guesses(bench, scale):
    """Tokens that are nearly right, the right one where it does not count, and many that are drawn."""
    target = bench.target()
    token = target.token
    first, last = ("1" if token[i] == "0" else "0" for i in (0, -1))
    near = ["", token[:-1], token + "0", token[:-1] + last, first + token[1:], token.upper() if token.upper() != token else "A" * 32,
            "%" + f"{ord(token[0]):02x}" + token[1:], " " + token, token + " ", token + "\0", token + "%00", "'" + token, token[::-1],
            token + "," + token, "*", "0" * 32, token * 2]
    queries = [f"?token={n}" for n in near] + [f"?Token={token}", f"?TOKEN={token}", f"?xtoken={token}", f"?token[]={token}",
               f"?token=&token={token}", f"?token=wrong&token={token}", f";token={token}", f"#token={token}", f"?token%3d{token}",
               f"?%74oken={token}", f"?a=?token={token}", f"?token =={token}", f"??token={token}", "?token", "?"]
    fields = [f"Authorization: Bearer {token}\r\n", f"Cookie: token={token}\r\n", f"Referer: http://127.0.0.1:{target.port}/?token={token}\r\n",
              f"X-Token: {token}\r\n", f"Sec-WebSocket-Protocol: {token}\r\n", f"X-Original-URL: /?token={token}\r\n"]
    for path, (query, field) in itertools.product(("/", "/socket"), [(q, "") for q in queries] + [("", f) for f in fields]):
        with target.stranger() as line:
            if path == "/socket":
                status = line.ask_for_socket(path + query, field)
            else:
                answers = line.get(path + query, field)
                status = answers[0].status if answers else 0
            expect(status in (400, 403, 404), f"{path}{query} {field.strip()} is answered {status}")
    random_, count = random.Random(7), int(3000 * scale)
    for _ in range(count):
        with target.stranger() as line:
            answers = line.get(f"/?token={random_.getrandbits(128):032x}")
            expect([a.status for a in answers] in ([403], []), f"a guess is answered {[a.status for a in answers]}")
    return f"{2 * (len(queries) + len(fields))} nearly right, {count} drawn; all refused"


def noise(bench, scale):
    """What is no HTTP: TLS, frames without a handshake, random bytes."""
    target, random_ = bench.target(), random.Random(11)
    said = [b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", frame(TEXT, '{"slice":null}'), frame(PING), b"\0" * 5000, b"\r\n\r\n",
            b"\n\n", b"GET", b"SSH-2.0-x\r\n", b"\xff" * 9000]
    said += [random_.randbytes(random_.randint(1, 3000)) for _ in range(int(300 * scale))]
    for data in said:
        with target.stranger() as line:
            line.send(data)
            line.socket.shutdown(1)
            received, is_ended = line.all(REQUEST_TIME_S + SLACK_S)
            expect(is_ended, f"{data[:20]} is not ended")
            expect(all(a.status in (400, 431) for a in answers_in(received)), f"{data[:20]} is answered {received[:20]}")
    refused = [frame(TEXT, '{"slice":{"axis":"z","position_m":0}}'), frame(PING, "x" * 125), frame(TEXT, b"x" * 100_000)]
    for data in refused:  # on the heels of a refusal
        with target.stranger() as line:
            line.send(upgrade(line.host, "/socket?token=wrong"))
            line.send(data)
            received, is_ended = line.all(REQUEST_TIME_S + SLACK_S)
            statuses = [a.status for a in answers_in(received)]
            expect(is_ended and statuses in ([403], [426], []), f"frames after a refusal are answered {statuses}")
    return f"{len(said) + len(refused)} connections"


STRANGERS = [idle_connections, slow_readers, slow_headers, storm, half_open, giant_headers, smuggling, traversal, methods, host_and_origin,
             guesses, noise, few_descriptors]
