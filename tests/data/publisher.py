"""A publisher's server on this machine, which may misbehave, and small collections to publish."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from mwlib.data.fetching import Patience
from tests.sample_motions import AMC, ASF

HASTY = Patience(silence=0.5, slowest=1e5, grace=1.5, retries=2, between=0.0)
PAGE = b"<!DOCTYPE html><html><body>Please sign in</body></html>"
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"ab" * 32 + b"\nsize 144051503\n"
LINES = {"status": b"HTTP/1.1 20", "header": b"HTTP/1.1 200 OK\r\nContent-Length: "}
LINES["chunk"] = b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n"


class Publisher:
    """What is published, what was asked for, and how the next answers go wrong.

    A trick is used up by one request: "drop" ends the connection amid the body, "stall" stops sending there, "cut" sends half and
    announces half, "more" announces more than is sent, "endless" never ends, "drip" sends a byte at a time, "status", "header"
    and "chunk" a line that is no body, "page" is a web page with status 200, "pointer" one of Git LFS, "empty" nothing, a number
    is a status. "slow" and "patient" send everything, with pauses; "hold" sends half, and the rest only at the end of the test.
    The rest of a file is sent where a request asks for it.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.tricks: dict[str, list[str | int]] = defaultdict(list)
        self.asked: list[str] = []  # paths
        self.begun: list[int] = []  # from which byte on
        self.agents: set[str] = set()
        self.at_once = self.most_at_once = 0
        self.gate, self.end = threading.Lock(), threading.Event()
        self.url = ""


def _handler(publisher: Publisher) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

        def do_GET(self) -> None:
            with publisher.gate:
                path = self.path.lstrip("/")
                publisher.asked.append(path)
                publisher.agents.add(self.headers["User-Agent"])
                publisher.at_once += 1
                self.counted = True
                publisher.most_at_once = max(publisher.at_once, publisher.most_at_once)
                tricks = publisher.tricks[path]
                trick = tricks.pop(0) if tricks else "patient" if publisher.tricks["*"] else ""
            try:
                self.answer(publisher.files.get(path), trick)
            except (BrokenPipeError, ConnectionResetError):
                pass
            finally:
                self.leave()

        def drip(self) -> None:
            """A digit, now and then."""
            while not publisher.end.wait(0.05):
                self.wfile.write(b"0")

        def leave(self) -> None:
            """No longer counted as being at work: just before the last byte, after which the other side may ask again."""
            with publisher.gate:
                publisher.at_once -= self.counted
                self.counted = False

        def answer(self, body: bytes | None, trick: str | int) -> None:
            self.close_connection = True
            if isinstance(trick, int) or body is None:
                self.send_response(trick if isinstance(trick, int) else 404)
                self.send_header("Retry-After", "0")
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            body = {"page": PAGE, "pointer": POINTER, "empty": b""}.get(trick, body)
            if trick in LINES:
                self.wfile.write(LINES[trick])
                return self.drip()
            start = int(self.headers.get("Range", "bytes=0-").removeprefix("bytes=").removesuffix("-"))
            publisher.begun.append(start)
            if start >= len(body) > 0:
                self.send_error(416)
                return
            self.send_response(206 if start else 200)
            body = body[start:]
            half = len(body) // 2
            announced = {"cut": half, "more": len(body) + 1000}.get(trick, len(body))
            if trick != "endless":
                self.send_header("Content-Length", str(announced))
            self.end_headers()
            if trick in ("slow", "patient"):
                step = 1 + len(body) // 10
                for start in range(0, len(body), step):
                    time.sleep(0.1 if trick == "slow" else 0.01)
                    if start + step >= len(body):
                        self.leave()
                    self.wfile.write(body[start : start + step])
                    self.wfile.flush()
            elif trick == "hold":
                self.wfile.write(body[:half])
                self.wfile.flush()
                publisher.end.wait()
            elif trick == "drip":
                self.drip()
            elif trick == "endless":
                while True:
                    self.wfile.write(bytes(10**6))
            else:
                self.leave()
                self.wfile.write(body[:half] if trick in ("drop", "stall", "cut") else body)
                self.wfile.flush()
                if trick == "stall":
                    publisher.end.wait()

    return Handler


@contextmanager
def serving() -> Iterator[Publisher]:
    """A publisher at work on a free port."""
    publisher = Publisher()
    with ThreadingHTTPServer(("127.0.0.1", 0), _handler(publisher)) as server:
        publisher.url = f"http://127.0.0.1:{server.server_port}"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield publisher
        finally:
            publisher.end.set()
            server.shutdown()
            thread.join()


def clip(turn: float) -> str:
    """An AMC text; each `turn` gives another motion."""
    first, *rest = AMC.split("root ", 1)
    numbers = rest[0].split(None, 1)
    return f"{first}root {float(numbers[0]) + turn} {numbers[1]}"


def publish_two_people(folder: Path) -> dict[str, bytes]:
    """Two people with two clips each, as CMU lays them out; their files by path."""
    texts = {f"{s}/{s}.asf": ASF for s in ("05", "09")}
    texts |= {f"{s}/{s}_{n:02}.amc": clip(10 * n + int(s)) for s in ("05", "09") for n in (1, 2)}
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return {name: text.encode() for name, text in texts.items()}
