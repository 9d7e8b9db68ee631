"""Processor time and memory for the control loop before all other programs, where the computer allows it.

The loop's thread asks for SCHED_FIFO. Only the watchdog's thread has it too, and stands above it: SCHED_RESET_ON_FORK
(sched(7)) makes every other thread, the worker, the recorder and each other child begin as ordinary ones. Where that is
not allowed, the loop asks for a negative nice value. Memory in use is locked (mlockall(2)), so that the loop waits for
no page that was swapped out; MCL_ONFAULT locks what is used, not what is reserved.
"""

import ctypes
import os
import resource
from typing import Final

import structlog

from chefbotd.core.record import Record

log = structlog.get_logger(component="process")

NICE: Final = -10
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # mman.h of Linux


class Priority(Record, frozen=True):
    """What the loop was given: a real-time priority (0: none), its nice value, and whether its memory is locked."""

    realtime: int = 0
    nice: int = 0
    memory_locked: bool = False

    def __str__(self) -> str:
        if self.realtime:
            return f"real-time priority {self.realtime}"
        return f"nice {self.nice}" if self.nice else "ordinary priority"


def raise_priority(realtime: int, *, lock_memory: bool) -> Priority:
    """Ask for priority for this thread, which runs the loop, and return what was given. 0 asks for none."""
    given = realtime if realtime and set_realtime(realtime) else 0
    if not given:
        _be_nice()
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    return Priority(given, nice, memory_locked=lock_memory and _lock_memory())


def log_priority(priority: Priority, realtime: int) -> None:
    """Log what was given; a warning if ``realtime`` was asked for and is not allowed."""
    write = log.info if priority.realtime or not realtime else log.warning
    write("the control loop's priority", has=str(priority), memory_locked=priority.memory_locked)


def set_realtime(priority: int) -> bool:
    """Give this thread, but not what it starts, a real-time priority. Returns whether that is allowed."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        return False
    return True


def _be_nice() -> None:
    """Lower this thread's nice value, where that is allowed. What it starts is not below 0 (sched(7))."""
    try:
        if os.getpriority(os.PRIO_PROCESS, 0) > NICE:
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    except OSError:
        return


def _lock_memory() -> bool:
    """Lock memory, but only without a limit: under one, later allocations would fail and end the daemon."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        return False
    try:
        locked: int = ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)
    except AttributeError:
        return False
    return locked == 0
