"""Threads for what may block at a device: open, close, drain, a name look-up.

Each call has a thread of its own. A pool would be full after a few devices that stall, and the process would wait at its
end for a pool's threads.
"""

import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class DeviceThreads(Executor):
    """Runs each call in a daemon thread; for ``loop.run_in_executor``."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> "Future[T]":
        """Start the call."""
        future: Future[T] = Future()
        threading.Thread(target=_run, args=(future, fn, args, kwargs), name="device", daemon=True).start()
        return future


def _run(
    future: "Future[Any]", fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> None:
    if not future.set_running_or_notify_cancel():
        return
    try:
        result = fn(*args, **kwargs)
    except BaseException as error:  # noqa: BLE001 - whoever awaits it gets it
        future.set_exception(error)
    else:
        future.set_result(result)


DEVICE_THREADS = DeviceThreads()
