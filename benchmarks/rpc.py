"""A caller of the command socket that blocks and does nothing else, so that it adds nothing to what is measured."""

import itertools
import json
import socket
import time
from typing import Any, Self

from websockets.sync.client import connect

ANSWER_WITHIN_S = 10.0


class CallFailed(Exception):
    """The daemon answered with an error, or hung up."""


class Caller:
    """One connection; notifications are read and forgotten."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=ANSWER_WITHIN_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._unread = b""
        self._ids = itertools.count(1)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def call(self, method: str, **params: object) -> dict[str, Any]:
        """Ask and wait for the answer; raises ``CallFailed`` when it is an error."""
        return self.timed_call(method, **params)[1]

    def timed_call(self, method: str, **params: object) -> tuple[int, dict[str, Any]]:
        """The same, with the monotonic time in nanoseconds just before the request went to the socket."""
        number = next(self._ids)
        request = json.dumps({"jsonrpc": "2.0", "id": number, "method": method, "params": params}).encode()
        sent_ns = time.monotonic_ns()
        self._send(request)
        while (answer := json.loads(self._line())).get("id") != number:
            pass
        if "error" in answer:
            raise CallFailed(f"{method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return sent_ns, result

    def discard(self, seconds: float) -> int:
        """Read whatever comes for so long, as a subscriber would; returns the number of lines."""
        end_s, lines = time.monotonic() + seconds, 0
        while (left_s := end_s - time.monotonic()) > 0:
            self._socket.settimeout(left_s)
            try:
                data = self._receive()
            except TimeoutError:
                break
            lines += data.count(b"\n")
            self._unread = (self._unread + data).rpartition(b"\n")[2]
        self._socket.settimeout(ANSWER_WITHIN_S)
        return lines

    def drive_for(
        self, seconds: float, linear_m_s: float, angular_rad_s: float, period_s: float = 0.1
    ) -> int:
        """Command this velocity again and again for so long; returns the number of other lines that came."""
        lines = 0
        for _ in range(round(seconds / period_s)):
            self.call("drive", linear_m_s=linear_m_s, angular_rad_s=angular_rad_s)
            lines += self.discard(period_s)
        return lines

    def _send(self, request: bytes) -> None:
        self._socket.sendall(request + b"\n")

    def _line(self) -> bytes:
        while b"\n" not in self._unread:
            self._unread += self._receive()
        line, _, self._unread = self._unread.partition(b"\n")
        return line

    def _receive(self) -> bytes:
        data = self._socket.recv(65536)
        if not data:
            raise CallFailed("the daemon hung up")
        return data


class WebCaller(Caller):
    """The same over the page's WebSocket."""

    def __init__(self, port: int) -> None:
        self._web = connect(f"ws://127.0.0.1:{port}/socket", compression=None, max_size=None)
        self._ids = itertools.count(1)

    def __exit__(self, *_: object) -> None:
        self._web.close()

    def read_for(self, seconds: float) -> int:
        """Read what comes for so long; returns the number of messages."""
        end_s, messages = time.monotonic() + seconds, 0
        while (left_s := end_s - time.monotonic()) > 0:
            try:
                self._web.recv(timeout=left_s)
            except TimeoutError:
                break
            messages += 1
        return messages

    def _send(self, request: bytes) -> None:
        self._web.send(request.decode())

    def _line(self) -> bytes:
        return str(self._web.recv(timeout=ANSWER_WITHIN_S)).encode()
