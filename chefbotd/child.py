"""Signals to a child process, whose exit code is not lost by them."""

import os
import signal
from asyncio.subprocess import Process
from contextlib import suppress


def send_signal(process: Process, number: signal.Signals) -> None:
    """Send this signal; harmless when the process has ended.

    The process's own ``kill`` and ``terminate`` take the exit code of one that has just ended, and asyncio, which waits
    for it, then reports 255 instead (https://github.com/python/cpython/issues/87744, until Python 3.13).
    """
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.kill(process.pid, number)
