"""What signals do, in a process of its own for each test: a loop that notes what it is told to end for."""

import signal
import subprocess
import sys

import pytest

from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.realtime

# Every signal of signal(7) on Linux, by hand. SIGIOT is SIGABRT, SIGPOLL is SIGIO, SIGCLD is SIGCHLD.
ENDS = [
    "SIGHUP",
    "SIGINT",
    "SIGQUIT",
    "SIGILL",
    "SIGTRAP",
    "SIGABRT",
    "SIGBUS",
    "SIGFPE",
    "SIGUSR1",
    "SIGSEGV",
]
ENDS += [
    "SIGUSR2",
    "SIGALRM",
    "SIGTERM",
    "SIGSTKFLT",
    "SIGXCPU",
    "SIGVTALRM",
    "SIGPROF",
    "SIGIO",
    "SIGPWR",
    "SIGSYS",
]
DOES_NOTHING = [
    "SIGPIPE",
    "SIGCHLD",
    "SIGCONT",
    "SIGTSTP",
    "SIGTTIN",
    "SIGTTOU",
    "SIGURG",
    "SIGXFSZ",
    "SIGWINCH",
]
CANNOT_BE_CAUGHT = ["SIGKILL", "SIGSTOP"]
FIRST_REAL_TIME, LAST_REAL_TIME = 34, 64  # the C library keeps 32 and 33 to itself

PROGRAM = """
import asyncio, ctypes, mmap, os, resource, signal, tempfile, threading, time, uvloop
from chefbotd.process import signals
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
signals.hold_crashes()
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
async def main():
    told = []
    signals.handle(told.append)
    for number in {numbers}:
        os.kill(os.getpid(), number)
        for _ in range({looks}):
            await asyncio.sleep(0.001)
            if told:
                break
        print(*told or ["-"])
        told.clear()
    {then}
with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
    runner.run(main())
"""


VANISHED_MEMORY = (
    "file = tempfile.TemporaryFile(); file.truncate(4096); "
    "memory = mmap.mmap(file.fileno(), 4096); file.truncate(0); memory[0]"
)


def told(numbers: list[int], *, looks: int = 1000, then: str = "") -> tuple[list[str], int]:
    """What the process noted for each of these signals, sent to itself, and how it ended."""
    program = PROGRAM.format(numbers=numbers, looks=looks, then=then)
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S
    )
    return ended.stdout.split(), ended.returncode


def test_every_signal_of_linux_has_its_place():
    """The lists below are complete: no signal that Python knows is in none of them, or in two."""
    listed = [*ENDS, *DOES_NOTHING, *CANNOT_BE_CAUGHT]
    real_time = set(range(FIRST_REAL_TIME, LAST_REAL_TIME + 1))
    assert len(listed) == len(set(listed)) == 31
    assert {signal.Signals[name] for name in listed} | real_time == signal.valid_signals()


def test_whatever_would_end_the_process_is_told():
    """Each signal that ends a process by default, sent by somebody, ends it by us instead, under its name."""
    assert told([int(signal.Signals[name]) for name in ENDS]) == (ENDS, 0)


def test_real_time_signals_are_told():
    """All thirty-one of them, counted from the first."""
    names = ["SIGRTMIN", *(f"SIGRTMIN+{number}" for number in range(1, 31))]
    assert told(list(range(FIRST_REAL_TIME, LAST_REAL_TIME + 1))) == (names, 0)


def test_what_does_no_harm_is_passed_over():
    """What is ignored by default, what Python turns into errors, and what would suspend the process: nothing happens."""
    numbers = [int(signal.Signals[name]) for name in DOES_NOTHING]
    assert told(numbers, looks=10) == (["-"] * len(DOES_NOTHING), 0)


@pytest.mark.parametrize(
    ("crash", "number"),
    [
        ("ctypes.string_at(0)", signal.SIGSEGV),
        (VANISHED_MEMORY, signal.SIGBUS),
        ("os.abort()", signal.SIGABRT),
    ],
    ids=["segfault", "bus", "abort"],
)
def test_a_crash_ends_the_process_at_once(crash: str, number: signal.Signals):
    """Code that cannot go on does not go on: whoever starts the daemon again has the motors stopped."""
    assert told([], then=crash) == ([], -number)
