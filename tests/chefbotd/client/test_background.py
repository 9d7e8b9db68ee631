"""The loop behind the synchronous client: whoever calls it while it ends is told so, and never waits for ever."""

import asyncio
import threading
import time

import pytest

from chefbotd.client.blocking import BackgroundLoop
from chefbotd.client.errors import ConnectionLost
from tests.waiting import PATIENCE_S


class Caller(threading.Thread):
    """Has one coroutine run, and keeps how that ended."""

    def __init__(self, loop: BackgroundLoop, seconds: float = 0.0) -> None:
        super().__init__(daemon=True)
        self._loop, self._seconds = loop, seconds
        self.ended: BaseException | None = None

    def run(self) -> None:
        """In the thread."""
        try:
            self._loop.run(asyncio.sleep(self._seconds))
        except ConnectionLost as lost:
            self.ended = lost


def test_who_calls_while_the_loop_stops_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last thing that the loop does is to stop: a call that comes in just then raises ``ConnectionLost``."""
    loop = BackgroundLoop()
    late, stop = Caller(loop), loop._loop.stop

    def stop_once_it_has_called() -> None:
        late.start()
        time.sleep(0.1)
        stop()

    monkeypatch.setattr(loop._loop, "stop", stop_once_it_has_called)
    loop.close()
    late.join(PATIENCE_S)
    assert not late.is_alive()
    assert isinstance(late.ended, ConnectionLost)


def test_who_waits_when_the_loop_is_closed_is_told_so() -> None:
    """Work that has not ended is cancelled, and its caller gets ``ConnectionLost``."""
    loop = BackgroundLoop()
    waiting = Caller(loop, seconds=3600.0)
    waiting.start()
    loop.run(asyncio.sleep(0))
    loop.close()
    waiting.join(PATIENCE_S)
    assert not waiting.is_alive()
    assert isinstance(waiting.ended, ConnectionLost)
    assert loop.closed
    loop.close()
