"""The client's end of the socket. It decodes lines, resolves pending calls, and passes notifications on."""

import asyncio
import itertools
import json
from collections.abc import Callable, Mapping
from typing import Any, cast

from chefbotd.client.errors import CallError, CallTimeout, ConnectionLost

OnNotification = Callable[[str, dict[str, Any]], None]
ProgressListener = Callable[[float, float, str], None]
"""Takes how far a request is: so much done of a total, and a text."""
MAX_LINE_BYTES = 1 << 20


class Wire(asyncio.Protocol):
    """One connection. When it is lost, ``lost`` holds the reason and every pending call raises it."""

    def __init__(self, on_notification: OnNotification, on_lost: Callable[[ConnectionLost], None]) -> None:
        self._on_notification, self._on_lost = on_notification, on_lost
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._on_progress: dict[int, ProgressListener] = {}
        self._ids = itertools.count(1)
        self._unfinished = bytearray()
        self._writable = asyncio.Event()
        self._lost_reason = ""
        self.lost: ConnectionLost | None = None
        self.closed = asyncio.Event()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: the socket is connected."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but its bases
        self._writable.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the socket is gone; ``exc`` is None when the daemon closed it in good order."""
        reason = self._lost_reason or str(exc or "the daemon closed the connection")
        self.lost = ConnectionLost(reason)
        for answer in self._answers.values():
            if not answer.done():
                answer.set_exception(ConnectionLost(reason))
        self._answers.clear()
        self._writable.set()
        self.closed.set()
        self._on_lost(self.lost)

    @property
    def peer_host(self) -> str:
        """The address of the daemon's end; empty: it is not known."""
        name = self._transport.get_extra_info("peername")
        return str(name[0]) if isinstance(name, tuple) and name else ""

    @property
    def has_reason(self) -> bool:
        """Whether the reason for the loss is known."""
        return bool(self._lost_reason)

    def pause_writing(self) -> None:
        """Asyncio: the daemon does not read as fast as we send."""
        self._writable.clear()

    def resume_writing(self) -> None:
        """Asyncio: there is room again."""
        self._writable.set()

    def data_received(self, data: bytes) -> None:
        """Asyncio: bytes from the daemon, cut anywhere."""
        self._unfinished += data
        *lines, rest = self._unfinished.split(b"\n")
        self._unfinished = rest
        for line in lines:
            self._take_line(line)
        if len(rest) > MAX_LINE_BYTES:
            self._abort(f"a line of more than {MAX_LINE_BYTES} bytes")

    def _take_line(self, line: bytearray) -> None:
        try:
            message = json.loads(line)
            method = message.get("method")
        except (ValueError, AttributeError):
            self._abort(f"no JSON object: {bytes(line[:60])!r}")
            return
        if method == "progress":
            self._report_progress(message.get("params", {}))
        elif method is not None:
            self._on_notification(method, message.get("params", {}))
        else:
            self._resolve(message)

    def _report_progress(self, params: Mapping[str, Any]) -> None:
        request_id = params.get("id") or 0
        report, answer = self._on_progress.get(request_id), self._answers.get(request_id)
        if report is None or answer is None or answer.done():
            return
        try:
            report(params["done"], params["total"], params["text"])
        except Exception as problem:  # noqa: BLE001 - the caller's own: it is raised where the answer is awaited
            answer.set_exception(problem)

    def _resolve(self, message: Mapping[str, Any]) -> None:
        error = CallError.from_wire(message["error"]) if "error" in message else None
        answer = self._answers.pop(message.get("id") or 0, None)
        if (
            answer is None or answer.done()
        ):  # no call is pending: the answer is late, or it concerns the connection itself
            self._lost_reason = error.message if error and message.get("id") is None else self._lost_reason
        elif error is not None:
            answer.set_exception(error)
        else:
            answer.set_result(message.get("result", {}))

    def _abort(self, reason: str) -> None:
        if not self._transport.is_closing():  # keep the first reason
            self._lost_reason = f"the daemon sent {reason}"
            self._transport.abort()

    async def call(
        self,
        method: str,
        params: Mapping[str, Any],
        timeout_s: float,
        on_progress: ProgressListener | None = None,
    ) -> dict[str, Any]:
        """Ask, and wait for the answer; each report for ``on_progress`` allows another ``timeout_s``.

        When the waiting task is cancelled, or the time is over, the daemon is asked to cancel the request.

        Raises:
            CallError: the daemon refused.
            CallTimeout: no answer came within ``timeout_s``.
            ConnectionLost: the connection is, or went, down.
        """
        request_id = next(self._ids)
        try:
            async with asyncio.timeout(timeout_s) as limit:
                if on_progress is not None:
                    self._on_progress[request_id] = _extending(limit, timeout_s, on_progress)
                answer = await self._send_request(request_id, method, params)
                return await answer
        except TimeoutError:
            raise CallTimeout(f"no answer to {method} within {timeout_s} s") from None
        finally:
            self._on_progress.pop(request_id, None)
            if self._answers.pop(request_id, None) is not None:  # nobody waits for it any more
                self.notify("cancel", {"id": request_id})

    async def _send_request(
        self, request_id: int, method: str, params: Mapping[str, Any]
    ) -> asyncio.Future[dict[str, Any]]:
        await self._writable.wait()
        if self.lost is not None:
            raise ConnectionLost(str(self.lost))
        request = {"jsonrpc": "2.0", "id": request_id, "method": method, "params": params}
        line = _line(request)  # may raise: before the call is registered as pending
        answer = self._answers[request_id] = asyncio.get_running_loop().create_future()
        self._transport.write(line)
        return answer

    def notify(self, method: str, params: Mapping[str, Any]) -> None:
        """Send a notification without waiting. Nothing is sent while the connection is lost or its buffer is full."""
        if self.lost is None and self._writable.is_set():
            self._transport.write(_line({"jsonrpc": "2.0", "method": method, "params": params}))

    async def close(self, patience_s: float) -> None:
        """Close the socket; abort it when the last bytes are not taken within ``patience_s`` seconds."""
        self._transport.close()
        try:
            async with asyncio.timeout(patience_s):
                await self.closed.wait()
        except TimeoutError:
            self._transport.abort()


def _extending(limit: asyncio.Timeout, timeout_s: float, on_progress: ProgressListener) -> ProgressListener:
    def report(done: float, total: float, text: str) -> None:
        limit.reschedule(asyncio.get_running_loop().time() + timeout_s)
        on_progress(done, total, text)

    return report


def _line(message: Mapping[str, Any]) -> bytes:
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"
