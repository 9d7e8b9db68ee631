"""Runs an event loop in its own thread, for programs without one."""

import asyncio
import concurrent.futures
import contextlib
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar

from chefbotd.client.errors import ConnectionLost

T = TypeVar("T")
LAST_WORDS_S = 2.0
"""For work that is interrupted, such as driving, which brakes first."""

CLOSED = "the client is closed"


class BackgroundLoop:
    """Runs coroutines for other threads. Its own thread does not keep the interpreter alive."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._closing = False
        self._handing_over = threading.Lock()  # whatever is handed over before the end is begun before it
        self._thread = threading.Thread(target=self._loop.run_forever, name="chefbotd-client", daemon=True)
        self._thread.start()

    @property
    def closed(self) -> bool:
        """Whether nothing more is begun here."""
        return self._closing

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """The coroutine's result. When the waiting is interrupted (Ctrl-C), the work is cancelled, and its end awaited.

        Raises:
            ConnectionLost: the loop is closed.
        """
        done: concurrent.futures.Future[T] = concurrent.futures.Future()
        tasks: list[asyncio.Task[T]] = []

        def begin() -> None:
            tasks.append(self._loop.create_task(work))
            tasks[0].add_done_callback(lambda task: _settle(done, task))

        with self._handing_over:
            if self._closing:
                work.close()
                raise ConnectionLost(CLOSED)
            self._loop.call_soon_threadsafe(begin)
        try:
            return done.result()
        except asyncio.CancelledError:
            raise ConnectionLost(CLOSED) from None
        except BaseException:
            if not done.done():
                with contextlib.suppress(RuntimeError):  # the loop is closed: the work was cancelled
                    self._loop.call_soon_threadsafe(lambda: tasks[0].cancel())
                concurrent.futures.wait([done], timeout=LAST_WORDS_S)
            raise

    def close(self) -> None:
        """Cancel what still runs, and end the thread; doing it twice is harmless."""
        with self._handing_over:
            if self._closing:
                return
            self._closing = True
            self._loop.call_soon_threadsafe(self._end)
        self._thread.join()
        self._loop.close()

    def _end(self) -> None:
        ending = self._loop.create_task(_cancel_others())
        ending.add_done_callback(lambda _: self._loop.stop())


async def _cancel_others() -> None:
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)


def _settle(done: "concurrent.futures.Future[T]", task: "asyncio.Task[T]") -> None:
    if task.cancelled():
        done.set_exception(asyncio.CancelledError())
    elif (error := task.exception()) is not None:
        done.set_exception(error)
    else:
        done.set_result(task.result())
