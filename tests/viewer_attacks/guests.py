"""Attacks by those who have the token: what a page sends is garbage, what it is sent it does not read."""

import random
import socket
import struct
import threading
import time
import zlib

from bench import Finding, expect
from wire import BINARY, CLOSE, PING, PONG, TEXT, Line, frame, kind_of

ENDS_IN_S = 15.0
MOST_PAGES = 32
FEW, WAITS_S = 5, 30.0  # messages that a page must be told beside a crowd, and how long it may take on a busy machine


def ended_with(target, data, what, codes):
    """Sends what no page would; the socket must be closed, with one of these codes (0: without one)."""
    with target.guest() as line:
        line.send(data)
        code = line.end(ENDS_IN_S)
        expect(code is not None, f"{what}: the socket is not closed")
        expect(code in codes, f"{what}: closed with {code}")


def malformed_frames(bench, _):
    """Frames that RFC 6455 forbids."""
    target = bench.target()
    wish = '{"slice": null}'
    frames = {"unmasked": frame(TEXT, wish, masked=False), "not of text": frame(BINARY, wish),
              "control of 126 bytes": frame(PING, "x" * 126), "control of 64 KiB": frame(PING, "x" * 65536),
              "control in parts": frame(PING, "x", fin=False), "close in parts": frame(CLOSE, b"\x03\xe8", fin=False),
              "close of a byte": frame(CLOSE, b"\x03"), "close with 1005": frame(CLOSE, b"\x03\xed"),
              "close with 0": frame(CLOSE, b"\0\0"), "close with 65535": frame(CLOSE, b"\xff\xff"),
              "close with no UTF-8": frame(CLOSE, b"\x03\xe8\xff\xfe"), "continuation of nothing": frame(0, wish),
              "text in text": frame(TEXT, '{"sl', fin=False) + frame(TEXT, 'ice": null}'),
              "length of 2^63": frame(TEXT, "x", length=1 << 63), "length of 2^64 - 1": frame(TEXT, "x", length=(1 << 64) - 1),
              "length of 2^31": frame(TEXT, "x", length=1 << 31), "length of 1 GiB in parts": frame(TEXT, "x", fin=False, length=1 << 30),
              "text of 257 bytes": frame(TEXT, wish + " " * (257 - len(wish))), "HTTP": b"GET / HTTP/1.1\r\n\r\n",
              "parts of 100 bytes": b"".join(frame(TEXT if i == 0 else 0, b" " * 100, fin=False) for i in range(10)),
              "length in 8 bytes of 2": b"\x81\xff" + (2).to_bytes(8, "big") + b"\0\0\0\0{}",
              "text of no UTF-8": frame(TEXT, b'{"slice": "\xff\xfe\xed\xa0\x80"}'), "lone surrogate": frame(TEXT, b"\xed\xa0\x80"),
              "overlong": frame(TEXT, b"\xc0\x80"), "UTF-8 cut off": frame(TEXT, b"\xf0\x9f"), "zeros": b"\0" * 64}
    frames |= {f"opcode {o}": frame(o, wish) for o in (3, 4, 5, 6, 7, 11, 12, 13, 14, 15)}
    frames |= {f"reserved bits {bits}": frame(TEXT, wish, reserved=bits) for bits in range(1, 8)}
    for what, data in frames.items():
        ended_with(target, data, what, (0, 1000, 1002, 1005, 1007, 1008, 1009, 65535))  # the last one told back
    with target.guest() as line:  # and who waits in the midst of one
        line.send(frame(TEXT, wish)[:5])
        expect(line.frame() is not None, "nothing is told amid a frame")
    return f"{len(frames)} frames"


def compression(bench, _):
    """Compression is not to be had, and 64 MiB in 64 KiB are not unpacked."""
    target = bench.target()
    bomb = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = bomb.compress(b" " * (64 << 20)) + bomb.flush(zlib.Z_SYNC_FLUSH)
    for offer in ("permessage-deflate", "permessage-deflate; client_max_window_bits", "x-webkit-deflate-frame"):
        with target.guest(f"Sec-WebSocket-Extensions: {offer}\r\n") as line:
            expect(b"xtensions" not in line.greeting, f"{offer} is granted")
            line.send(frame(TEXT, packed[:65535], reserved=4))
            expect(line.end(ENDS_IN_S) is not None, "a compressed frame is read")
    return f"{len(packed) >> 10} KiB that are 64 MiB, offered three times"


def garbage(bench, _):
    """What is no wish for a slice ends the socket; wishes that are out of all bounds are slices like others."""
    target, random_ = bench.target(), random.Random(5)
    said = ["", "stop", "null", "0", "[]", "{}", "[" * 256, '{"slice":' * 28, '{"slice": {}}', '{"slice": []}', '{"slice": 1}',
            '{"stop": true}', '{"goal": [0, 0]}', '{"slice": null, "goal": [0, 0]}', '{"slice": {"axis": "w", "position_m": 0}}',
            '{"slice": {"axis": "z", "position_m": NaN}}', '{"slice": {"axis": "z", "position_m": 1e999}}', 
            '{"slice": {"axis": "z", "position_m": "0"}}', '{"slice": {"axis": "z", "position_m": 0, "ahead_s": null}}',
            '{"slice": {"axis": "z", "position_m": 0, "x": 1}}', '{"slice": null}{"slice": null}', '{"slice": null} x', "'",
            '{"__proto__": null}', '{"slice": {"axis": null, "position_m": 0}}', '{"Slice": null}', '\0{"slice": null}']
    said += [bytes(random_.choices(b'{}[]",:0123456789.eE+-slicexyznu\\ ', k=random_.randint(1, 250))).decode() for _ in range(60)]
    for text in said:
        ended_with(target, frame(TEXT, text), text[:40], (1008,))
    extremes = ["1e308", "-1e308", "0", "-0.0", "1e-320", "9223372036854775808", "-9223372036854775809", "18446744073709551616", "4294967296"]
    served = 0
    with target.guest() as line:
        for position in extremes:
            for axis, ahead in zip("xyz", ("", ', "ahead_s": ' + position, ', "ahead_s": -1e9'), strict=True):
                line.send(frame(TEXT, f'{{"slice": {{"axis": "{axis}", "position_m": {position}{ahead}}}}}'))
                served += slice_comes(line, axis)
    return f"{len(said)} texts ended the socket, {served} slices of out-of-bounds wishes came"


def slice_comes(line, axis):
    """Whether the next slice along this axis comes; the socket must go on."""
    until = time.monotonic() + ENDS_IN_S
    while time.monotonic() < until:
        got = line.frame()
        if got is None or got[0] == CLOSE:
            raise OSError("the socket has ended")
        if got[0] == BINARY:
            kind, header = kind_of(got[1])
            if kind == "slice" and header["axis"] == axis:
                return 1
    raise Finding("no slice comes")


def giants(bench, scale):
    """Text that never ends: without a byte in each part, and pings amid parts, as fast as they are taken."""
    target = bench.target()
    empty = frame(TEXT, b"", fin=False) + frame(0, b"", fin=False) * 2000
    between = frame(TEXT, b"{", fin=False) + frame(PING, "x" * 125) * 200
    sent, begin = 0, time.monotonic()
    for first, more in ((empty, frame(0, b"", fin=False) * 2000), (between, frame(PING, "x" * 125) * 200)):
        with target.guest(patience_s=2.0) as line:
            data, until = first, time.monotonic() + 3.0 * scale
            while time.monotonic() < until and line.send(data):
                sent, data = sent + len(data), more
    return f"{sent >> 20} MiB in {time.monotonic() - begin:.1f} s"


def read_all(line, until, heard):
    """Reads what comes, answers pings, and notes when each message came; waits a while longer for a few."""
    while time.monotonic() < until or (len(heard) <= FEW and time.monotonic() < until + WAITS_S):
        got = line.frame()
        if got is None:
            return
        if got[0] == PING:
            line.send(frame(PONG, got[1]))
        if got[0] == BINARY:
            heard.append(time.monotonic())


def visit(place, is_over, act, number, counts, **options):
    """A socket with which `act` is called again and again; another one where it ends. `counts`: sockets opened, calls."""
    line, state = None, {}

    def leave():
        if line is not None:
            line.close()

    while not is_over():
        try:
            if line is None:
                line, state = place.guest(patience_s=2.0, **options), {"number": number}
                counts[0] += 1
            counts[1] += 1
            if act(line, state) is False:
                leave()
                line = None
        except (OSError, Finding):
            leave()
            line = None
            time.sleep(0.05)
    leave()


def among_guests(target, seconds, act, count, **options):
    """So many sockets, each of which `act` is called with again and again, while a page looks on."""
    until, heard, counts = time.monotonic() + seconds, [], [0, 0]

    def go(number):
        visit(target, lambda: time.monotonic() >= until or not target.alive(), act, number, counts, **options)

    with target.guest() as watching:
        threads = [threading.Thread(target=read_all, args=(watching, until, heard), daemon=True)]
        threads += [threading.Thread(target=go, args=(i,), daemon=True) for i in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(seconds + 2 * WAITS_S)
    if target.alive():
        expect(len(heard) > FEW, f"a page beside them was told {len(heard)} times in {seconds + WAITS_S:.0f} s")
    return f"{counts[0]} sockets; a page beside them was told {len(heard)} times"


def deaf(bench, scale):
    """31 pages that read nothing, each of which wants another slice."""
    target = bench.target()

    def act(line, state):
        if not state.get("said"):
            line.send(frame(TEXT, f'{{"slice": {{"axis": "z", "position_m": {state["number"] / 20}}}}}'))
            state["said"] = True
        time.sleep(0.2)
        return True

    return among_guests(target, 20.0 * scale, act, MOST_PAGES - 1, buffer_bytes=1)


def slow(bench, scale):
    """31 pages that read a byte at a time."""
    def act(line, _):
        time.sleep(0.05)
        return line.socket.recv(1) != b""

    return among_guests(bench.target(), 6.0 * scale, act, MOST_PAGES - 1, buffer_bytes=1)


def wish_of(line, state):
    """50 wishes for slices that nobody has had."""
    state["n"] = state.get("n", 0) + 1
    texts = [f'{{"slice": {{"axis": "{"xyz"[i % 3]}", "position_m": {state["number"] + (state["n"] * 50 + i) / 1000}}}}}'
             for i in range(50)]
    if not line.send(b"".join(frame(TEXT, text) for text in texts)):
        return False
    line.socket.setblocking(False)
    data = line.more()
    while data:
        data = line.more()
    line.socket.settimeout(2.0)
    return data is None


def wishes(bench, scale):
    """31 pages that want another slice as fast as they can say so."""
    return among_guests(bench.target(), 6.0 * scale, wish_of, MOST_PAGES - 1)


FLOOD = frame(PING, "x" * 125) * 500


def ping_of(line, _):
    return line.send(FLOOD)


def pings(bench, scale):
    """Pings without end, whose answers nobody reads."""
    return among_guests(bench.target(), 5.0 * scale, ping_of, 8, buffer_bytes=1)


def come_and_go_of(line, state):
    """Leaves by a reset, at once or amid a frame, its own or the server's."""
    if state["number"] % 3 == 1:
        line.send(frame(TEXT, '{"slice": null}')[:4])
    if state["number"] % 3 == 2:
        line.socket.recv(100)
    line.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    return False


def come_and_go(bench, scale):
    """Pages that connect and are reset."""
    return among_guests(bench.target(), 6.0 * scale, come_and_go_of, 12)


def one_too_many(bench, _):
    """The page after the last is told why there is no place for it."""
    target, lines = bench.target(), []
    try:
        while len(lines) < MOST_PAGES:
            lines.append(target.guest())
        with Line(target.port) as line:
            status = line.ask_for_socket("/socket" + target.query)
            expect(status == 503, f"page {MOST_PAGES + 1} is answered {status}")
            expect(b"too many pages" in line.all()[0], "it is not told why")
    finally:
        for line in lines:
            line.close()
    return f"{MOST_PAGES} pages; the next one was told why not"


def lifeless(bench, scale):
    """Pages that have connected, and do not even answer pings, are dropped; takes a minute."""
    if scale < 1.0:
        return "left out"
    target = bench.target()
    with target.guest() as line:
        begin, until = time.monotonic(), time.monotonic() + 75
        while time.monotonic() < until:  # reads, so that it is not dropped as deaf
            got = line.frame()
            if got is None:
                return f"dropped after {time.monotonic() - begin:.0f} s"
    if not target.alive():
        raise OSError("the run has ended")
    raise Finding("who gives no sign of life is not dropped within 75 s")


GUESTS = [malformed_frames, compression, garbage, giants, deaf, slow, wishes, pings, come_and_go, one_too_many, lifeless]
