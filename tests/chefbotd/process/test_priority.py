"""The control loop's thread before other programs, and none of what it starts."""

import ctypes
import json
import os
import subprocess
import sys

import pytest

from chefbotd.process import watchdog
from chefbotd.process.watchdog import Priority, raise_priority

PROGRAM = """
import json, os, subprocess, sys, threading
from chefbotd.process.watchdog import raise_priority, set_realtime

def mine():
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, os.getpriority(os.PRIO_PROCESS, 0)

told = [str(raise_priority(7, lock_memory=False)), mine()]
for work in (mine, lambda: (set_realtime(8), *mine())):
    thread = threading.Thread(target=lambda: told.append(work()))
    thread.start()
    thread.join()
child = "import os; print(os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0))"
told.append(subprocess.run([sys.executable, "-c", child], capture_output=True, text=True).stdout.split())
print(json.dumps(told))
"""


def may_be_realtime() -> bool:
    """Whether this computer gives us what the loop asks for."""
    asks = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(8))"
    return subprocess.run([sys.executable, "-c", asks], capture_output=True, check=False).returncode == 0


def test_the_loop_and_its_watchdog_are_before_all_others_and_nothing_else_is() -> None:
    """The loop has 7 and the watchdog 8; a thread and a child that the loop starts are ordinary ones."""
    if not may_be_realtime():
        pytest.skip("no real-time priority is allowed here")
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    told, loop, thread, watchdog, child = json.loads(done.stdout.splitlines()[-1])
    fifo, own = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.nice(0)  # the tests may be nice themselves
    assert told == "real-time priority 7"
    assert loop == [fifo, 7, own]
    assert thread == [os.SCHED_OTHER, 0, 0]
    assert watchdog == [True, fifo, 8, 0]
    assert child == [str(os.SCHED_OTHER), "0"]


class Kernel:
    """Allows what it is told to allow, and remembers what was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, allowed: frozenset[str], nice: int = 0) -> None:
        self.allowed, self.nice = allowed, nice
        self.asked: list[tuple[str, int]] = []
        monkeypatch.setattr(os, "sched_setscheduler", self._schedule)
        monkeypatch.setattr(os, "getpriority", lambda which, who: self.nice)
        monkeypatch.setattr(os, "setpriority", self._set_nice)
        monkeypatch.setattr(ctypes, "CDLL", lambda *names, **options: self)

    def _ask(self, what: str, value: int) -> None:
        self.asked.append((what, value))
        if what not in self.allowed:
            raise PermissionError(1, "Operation not permitted")

    def _schedule(self, pid: int, policy: int, parameter: os.sched_param) -> None:
        assert policy & os.SCHED_RESET_ON_FORK
        kind = "fifo" if policy & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO else "other"
        self._ask(kind, parameter.sched_priority)

    def _set_nice(self, which: int, who: int, value: int) -> None:
        self._ask("nice", value)
        self.nice = value

    def mlockall(self, flags: int) -> int:
        """Lock what is in use, or not."""
        self.asked.append(("lock", flags))
        return 0 if "lock" in self.allowed else -1


@pytest.mark.parametrize(
    ("allowed", "given"),
    [
        ({"fifo", "lock"}, Priority(10, 0, memory_locked=True)),
        ({"nice", "other"}, Priority(0, -10)),
        (set(), Priority()),
    ],
    ids=["everything", "a nice value", "nothing"],
)
def test_what_the_computer_allows_is_taken(
    monkeypatch: pytest.MonkeyPatch, allowed: set[str], given: Priority
) -> None:
    """Real time, else a nice value, else nothing: no refusal ends the daemon."""
    monkeypatch.setattr(watchdog.os, "geteuid", lambda: 0)
    Kernel(monkeypatch, frozenset(allowed))
    assert raise_priority(10, lock_memory=True) == given


def test_a_nice_value_that_the_unit_has_set_is_kept_from_what_the_loop_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is to be raised, and the worker does not begin with it."""
    kernel = Kernel(monkeypatch, frozenset({"other"}), nice=-10)
    assert raise_priority(0, lock_memory=False) == Priority(0, -10)
    assert kernel.asked == [("other", 0)]


def test_memory_is_not_locked_under_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """With 8 MB allowed, the next request for memory would be refused: nothing is locked."""
    kernel = Kernel(monkeypatch, frozenset({"fifo", "lock"}))
    monkeypatch.setattr(watchdog.os, "geteuid", lambda: 1000)
    monkeypatch.setattr(watchdog.resource, "getrlimit", lambda which: (8 << 20, 8 << 20))
    assert not raise_priority(10, lock_memory=True).memory_locked
    assert ("lock", 7) not in kernel.asked
    monkeypatch.setattr(watchdog.resource, "getrlimit", lambda which: (watchdog.resource.RLIM_INFINITY,) * 2)
    assert raise_priority(10, lock_memory=True).memory_locked
    assert ("lock", 7) in kernel.asked
