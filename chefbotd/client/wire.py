"""The client's end of the socket: lines to messages, answers to whoever asked, the rest to a listener."""

import asyncio
import itertools
import json
from collections.abc import Callable, Mapping
from typing import Any, cast

from chefbotd.client.errors import CallError, CallTimeout, ConnectionLost

Listener = Callable[[str, dict[str, Any]], None]
MAX_LINE_BYTES = 1 << 20


class Wire(asyncio.Protocol):
    """One connection; ``lost`` says why it is gone, and then everyone who waits for an answer is told."""

    def __init__(self, on_notification: Listener, on_lost: Callable[[ConnectionLost], None]) -> None:
        self._on_notification, self._on_lost = on_notification, on_lost
        self._answers: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._ids = itertools.count(1)
        self._unfinished = bytearray()
        self._writable = asyncio.Event()
        self._complaint = ""
        self.lost: ConnectionLost | None = None
        self.closed = asyncio.Event()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: the socket is connected."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but its bases
        self._writable.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the socket is gone; ``exc`` is None when the daemon closed it in good order."""
        reason = self._complaint or str(exc or "the daemon closed the connection")
        self.lost = ConnectionLost(reason)
        for answer in self._answers.values():
            if not answer.done():
                answer.set_exception(ConnectionLost(reason))
        self._answers.clear()
        self._writable.set()
        self.closed.set()
        self._on_lost(self.lost)

    @property
    def explained(self) -> bool:
        """Whether the other end said, or showed, why the connection is lost."""
        return bool(self._complaint)

    def pause_writing(self) -> None:
        """Asyncio: the daemon does not read as fast as we ask."""
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
            self._take(line)
        if len(rest) > MAX_LINE_BYTES:
            self._give_up(f"a line of more than {MAX_LINE_BYTES} bytes")

    def _take(self, line: bytearray) -> None:
        try:
            message = json.loads(line)
            method = message.get("method")
        except (ValueError, AttributeError):
            self._give_up(f"no JSON object: {bytes(line[:60])!r}")
            return
        if method is not None:
            self._on_notification(method, message.get("params", {}))
        else:
            self._settle(message)

    def _settle(self, message: Mapping[str, Any]) -> None:
        error = CallError.from_wire(message["error"]) if "error" in message else None
        answer = self._answers.pop(message.get("id") or 0, None)
        if (
            answer is None or answer.done()
        ):  # nobody waits: it came too late, or it is about the connection itself
            self._complaint = error.message if error and message.get("id") is None else self._complaint
        elif error is not None:
            answer.set_exception(error)
        else:
            answer.set_result(message.get("result", {}))

    def _give_up(self, complaint: str) -> None:
        if not self._transport.is_closing():  # what follows the first complaint is of no interest
            self._complaint = f"the daemon sent {complaint}"
            self._transport.abort()

    async def call(self, method: str, params: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Ask, and wait for the answer.

        Raises:
            CallError: the daemon refused.
            CallTimeout: no answer came within ``timeout_s``.
            ConnectionLost: the connection is, or went, down.
        """
        request_id = next(self._ids)
        try:
            async with asyncio.timeout(timeout_s):
                answer = await self._ask(request_id, method, params)
                return await answer
        except TimeoutError:
            raise CallTimeout(f"no answer to {method} within {timeout_s} s") from None
        finally:
            self._answers.pop(request_id, None)

    async def _ask(
        self, request_id: int, method: str, params: Mapping[str, Any]
    ) -> asyncio.Future[dict[str, Any]]:
        await self._writable.wait()
        if self.lost is not None:
            raise ConnectionLost(str(self.lost))
        request = {"jsonrpc": "2.0", "id": request_id, "method": method, "params": params}
        line = _line(request)  # may raise, and then nobody waits for an answer
        answer = self._answers[request_id] = asyncio.get_running_loop().create_future()
        self._transport.write(line)
        return answer

    def tell(self, method: str, params: Mapping[str, Any]) -> None:
        """Ask for something whose answer nobody waits for; never waits, and does nothing on a lost connection."""
        if self.lost is None and self._writable.is_set():
            self._transport.write(_line({"jsonrpc": "2.0", "method": method, "params": params}))

    async def close(self, patience_s: float) -> None:
        """Close the socket; a daemon that does not take our last bytes within ``patience_s`` is cut off."""
        self._transport.close()
        try:
            async with asyncio.timeout(patience_s):
                await self.closed.wait()
        except TimeoutError:
            self._transport.abort()


def _line(message: Mapping[str, Any]) -> bytes:
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"
