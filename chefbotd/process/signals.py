"""The daemon's reaction to signals: it ends with a stop, or ignores them. No signal may freeze a moving robot."""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Callable

BEYOND_US = frozenset({signal.SIGKILL, signal.SIGSTOP})
"""Signals that no process can catch or ignore."""

HARMLESS = frozenset(
    {
        signal.SIGCHLD,
        signal.SIGCONT,
        signal.SIGURG,
        signal.SIGWINCH,
        signal.SIGPIPE,
        signal.SIGXFSZ,
    }
)
"""Signals that end nothing: the kernel ignores the first four, Python the last two."""

SUSPENDING = frozenset({signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU})
"""Signals that would suspend the process; they are ignored, because a suspended daemon cannot stop its motors."""

CRASHES = frozenset({signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGTRAP})
"""Signals of code that has crashed. A handler would return to that code for ever, with the motors on.

They are blocked instead. One that another process *sent* is waited for. One that a crash raises still ends the process,
and the next start stops the motors.
"""

ENDING = frozenset(signal.valid_signals()) - BEYOND_US - HARMLESS - SUSPENDING - CRASHES
"""All other signals that would end the process at once, the real-time signals included."""

End = Callable[[str], object]


def hold_crashes() -> None:
    """Block ``CRASHES``. Call it before any thread starts, because threads inherit what is blocked."""
    signal.pthread_sigmask(signal.SIG_BLOCK, CRASHES)


def handle(end: End, reload: Callable[[], object] | None = None) -> None:
    """Call ``end`` with the name of any signal that should end the process, in the running loop; ignore ``SUSPENDING``.

    For ``CRASHES`` that works where they are held. With ``reload``, SIGHUP calls that instead: a service has no terminal
    whose closing it would tell of.
    """
    loop = asyncio.get_running_loop()
    for number in ENDING:
        loop.add_signal_handler(number, end, name_of(number))
    if reload is not None:
        loop.add_signal_handler(signal.SIGHUP, reload)
    for number in SUSPENDING:
        signal.signal(number, signal.SIG_IGN)
    if signal.pthread_sigmask(signal.SIG_BLOCK, ()) >= CRASHES:
        threading.Thread(target=_await_crashes, args=(loop, end), name="signals", daemon=True).start()


def name_of(number: int) -> str:
    """The name of a signal, as in signal(7)."""
    first = int(signal.SIGRTMIN)
    return f"SIGRTMIN+{number - first}" if number > first else signal.Signals(number).name


def _await_crashes(loop: asyncio.AbstractEventLoop, end: End) -> None:
    while True:
        name = name_of(signal.sigwait(CRASHES))
        with contextlib.suppress(RuntimeError):  # a closed loop: we are at the end already
            loop.call_soon_threadsafe(end, name)
