"""What signals do to the daemon: end it, with a stop on the way out, or nothing. None may freeze a robot in motion."""

import asyncio
import signal
from collections.abc import Callable

ENDING = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGUSR2,
    signal.SIGALRM,
    signal.SIGVTALRM,
    signal.SIGPROF,
    signal.SIGXCPU,
    signal.SIGPWR,
    signal.SIGIO,
    signal.SIGSTKFLT,
)
"""Everything that would end the process without a word and can be caught."""

SUSPENDING = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
"""A daemon that Ctrl-Z put to sleep could not stop its motors: these are ignored. (SIGSTOP cannot be.)"""


def handle(end: Callable[[signal.Signals], None]) -> None:
    """Call ``end`` in the running loop for every signal that should end the process; ignore those that suspend it."""
    loop = asyncio.get_running_loop()
    for number in ENDING:
        loop.add_signal_handler(number, end, number)
    for number in SUSPENDING:
        signal.signal(number, signal.SIG_IGN)
