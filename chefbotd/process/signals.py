"""The daemon's reaction to signals: it ends with a stop, or ignores them. No signal may freeze a moving robot."""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Callable

BEYOND_US = frozenset({signal.SIGKILL, signal.SIGSTOP})
"""No process can do anything about these."""

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
"""The kernel ignores the first four unless told otherwise, Python the last two: the write that failed tells of those."""

SUSPENDING = frozenset({signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU})
"""A daemon that Ctrl-Z put to sleep could not stop its motors: these are ignored. (SIGSTOP cannot be.)"""

CRASHES = frozenset({signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGTRAP})
"""What the kernel says to code that cannot go on. A handler would return to that code, for ever, with the motors on.

So they are blocked: one that somebody *sent* is waited for, one that a crash raises ends the process all the same, and
starting it again stops the motors.
"""

ENDING = frozenset(signal.valid_signals()) - BEYOND_US - HARMLESS - SUSPENDING - CRASHES
"""Everything else that would end the process without a word, the real-time signals too."""

End = Callable[[str], object]


def hold_crashes() -> None:
    """Block ``CRASHES``; to be called before any thread is started, for a thread inherits what is blocked."""
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
    """As signal(7) has it: the real-time signals count from the first."""
    first = int(signal.SIGRTMIN)
    return f"SIGRTMIN+{number - first}" if number > first else signal.Signals(number).name


def _await_crashes(loop: asyncio.AbstractEventLoop, end: End) -> None:
    while True:
        name = name_of(signal.sigwait(CRASHES))
        with contextlib.suppress(RuntimeError):  # a closed loop: we are at the end already
            loop.call_soon_threadsafe(end, name)
