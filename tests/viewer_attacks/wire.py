"""TCP, HTTP and WebSocket (RFC 6455) byte by byte, as somebody speaks them who means harm."""

import json
import os
import re
import socket
import struct
import time

KEY = "dGhlIHNhbXBsZSBub25jZQ=="
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


class Answer:
    """What HTTP has for one request."""

    def __init__(self, status, fields, body):
        self.status, self.fields, self.body = status, fields, body


def answers_in(received):
    """All answers in what a connection received; what is none is one of status 0."""
    answers = []
    while received:
        head, end, rest = received.partition(b"\r\n\r\n")
        begin = re.match(rb"HTTP/1\.1 (\d{3}) ", head)
        if not begin or not end:
            return answers + [Answer(0, {}, received)]
        fields = dict(line.split(b": ", 1) for line in head.split(b"\r\n")[1:] if b": " in line)
        length = int(fields.get(b"Content-Length", b"0"))
        answers.append(Answer(int(begin[1]), fields, rest[:length]))
        if answers[-1].status == 101:
            return answers if not rest else answers + [Answer(0, {}, rest)]
        received = rest[length:]
    return answers


class Line:
    """One connection. `heard` is called with every byte that comes."""

    def __init__(self, port, buffer_bytes=None, patience_s=20.0, heard=None):
        self.socket = socket.socket()
        self.port, self.heard, self.left = port, heard, b""
        if buffer_bytes:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
        self.socket.settimeout(patience_s)
        try:
            self.socket.connect(("127.0.0.1", port))
        except OSError:
            self.socket.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def host(self):
        return f"127.0.0.1:{self.port}"

    def close(self):
        self.socket.close()

    def reset(self):
        """Ends it at once, by RST."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()

    def send(self, data):
        """False once the other side has gone, or takes no more."""
        try:
            self.socket.sendall(data if isinstance(data, bytes) else data.encode("latin-1"))
            return True
        except OSError:
            return False

    def more(self):
        """What comes next; nothing once the connection has ended, None where nothing comes in time."""
        try:
            data = self.socket.recv(1 << 16)
        except (socket.timeout, BlockingIOError):
            return None
        except OSError:
            return b""
        if data and self.heard:
            self.heard(data)
        return data

    def all(self, limit_s=20.0):
        """All that comes until the other side ends it, and whether it has."""
        until, received = time.monotonic() + limit_s, self.left
        self.left = b""
        while (wait_s := until - time.monotonic()) > 0:
            self.socket.settimeout(wait_s)
            data = self.more()
            if not data:
                return received, data is not None
            received += data
        return received, False

    def head(self):
        """An answer's head, with the empty line, as far as it comes."""
        while b"\r\n\r\n" not in self.left:
            data = self.more()
            if not data:
                break
            self.left += data
        head, end, self.left = self.left.partition(b"\r\n\r\n")
        return head + end

    def get(self, target, fields="", method="GET", limit_s=20.0):
        """The answers to one request."""
        self.send(f"{method} {target} HTTP/1.1\r\nHost: {self.host}\r\n{fields}\r\n")
        return answers_in(self.all(limit_s)[0])

    def ask_for_socket(self, target, fields=""):
        """The status of the answer; 0 where none comes."""
        self.send(upgrade(self.host, target, fields))
        head = self.head()
        status = re.match(rb"HTTP/1\.1 (\d{3}) ", head)
        self.greeting = head
        return int(status[1]) if status else 0

    def frame(self):
        """(opcode, payload) of the next frame; None once there is none."""
        def fill(count):
            while len(self.left) < count:
                data = self.more()
                if not data:
                    return False
                self.left += data
            return True

        if not fill(2):
            return None
        opcode, length = self.left[0] & 15, self.left[1] & 127
        more = {126: 2, 127: 8}.get(length, 0)
        if not fill(2 + more):
            return None
        if more:
            length = int.from_bytes(self.left[2:2 + more], "big")
        if not fill(2 + more + length):
            return None
        payload, self.left = self.left[2 + more:2 + more + length], self.left[2 + more + length:]
        return opcode, payload

    def end(self, limit_s=20.0):
        """The code that the other side closes the socket with; 0 where it ends without, None where it goes on."""
        until = time.monotonic() + limit_s
        self.socket.settimeout(limit_s)
        while time.monotonic() < until:
            frame = self.frame()
            if frame is None:
                return 0 if time.monotonic() < until else None
            if frame[0] == CLOSE:
                return int.from_bytes(frame[1][:2], "big")
        return None


def upgrade(host, target, fields="", method="GET"):
    return (f"{method} {target} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {KEY}\r\n{fields}\r\n")


def frame(opcode, payload=b"", fin=True, reserved=0, masked=True, length=None):
    """A client's frame; `length` is what it says, where that is not the truth."""
    payload = payload if isinstance(payload, bytes) else payload.encode()
    said = len(payload) if length is None else length
    first = bytes([fin << 7 | reserved << 4 | opcode])
    second = masked << 7
    if said < 126:
        head = first + bytes([second | said])
    elif said < 1 << 16:
        head = first + bytes([second | 126]) + said.to_bytes(2, "big")
    else:
        head = first + bytes([second | 127]) + said.to_bytes(8, "big")
    if not masked:
        return head + payload
    mask = os.urandom(4)
    pad = (mask * (len(payload) // 4 + 1))[:len(payload)]
    return head + mask + (int.from_bytes(payload, "big") ^ int.from_bytes(pad, "big")).to_bytes(len(payload), "big")


def kind_of(message):
    """The `kind` of a message to the page, and its header."""
    length = int.from_bytes(message[:4], "little")
    header = json.loads(message[4:4 + length])
    return header["kind"], header
