"""What the daemon costs at a 100 Hz board cycle with one subscriber, and where that goes.

The robot drives, commanded ten times a second, and one client takes every event of ``odometry`` and ``wheels``: on the
lean board, then on ``chefbotd simulate``. The shares come from ``parts``: the same work done in this process.
"""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from benchmarks import parts
from benchmarks.board import board
from benchmarks.figures import Figure, Outcome
from benchmarks.rig import CHEFBOTD, Daemon, connect, daemon
from benchmarks.rpc import Caller

CYCLE_HZ = 100
SECONDS = 15.0
TWIST = (0.1, 0.4)
TOPICS = ("odometry", "wheels")


def run(*, quick: bool = False) -> Outcome:
    """Share of a core and resident memory on both boards, and microseconds a cycle by part."""
    seconds = SECONDS / 3 if quick else SECONDS
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        instrument.start(1 / CYCLE_HZ)
        cores, events = _load(running, caller, seconds)
        resident_mb = running.resident_mb()
    with _simulated_board() as device, daemon(device) as running, connect(running) as caller:
        simulated_cores, simulated_events = _load(running, caller, seconds)
    figures = (
        Figure("daemon at 100 Hz", cores, "core", 0.04, "0.27-0.35"),
        Figure("daemon at 100 Hz, chefbotd simulate", simulated_cores, "core", 0.04),
        Figure("resident memory", resident_mb, "MB", 90.0, "368"),
        *_shares(cores),
    )
    hz, simulated_hz = (lines / len(TOPICS) / seconds for lines in (events, simulated_events))
    remark = f"the lean board reached {hz:.1f} Hz, chefbotd simulate {simulated_hz:.1f} Hz: it waits for its echoes"
    return Outcome(figures, remarks=(remark,))


def _load(running: Daemon, caller: Caller, seconds: float) -> tuple[float, int]:
    """Processor seconds of the daemon per second, and the lines that the subscriber got."""
    caller.call("subscribe", topics=TOPICS, policy="ordered")
    caller.drive_for(1.0, *TWIST)
    began_s, before_s = time.monotonic(), running.cpu_s()
    lines = caller.drive_for(seconds, *TWIST)
    return (running.cpu_s() - before_s) / (time.monotonic() - began_s), lines


@contextmanager
def _simulated_board() -> Iterator[str]:
    command = [CHEFBOTD, "simulate", "--cycle-hz", str(CYCLE_HZ)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def _shares(cores: float) -> tuple[Figure, ...]:
    """Each part's share of what the daemon used; the loop's is what the parts do not explain."""
    used_us = cores / CYCLE_HZ * 1e6
    by_part = parts.run()
    loop_us = used_us - sum(figure.value for figure in by_part)
    named = (*by_part, Figure("loop, system calls, commands", loop_us, "us"))
    return tuple(replace(f, name=f"a cycle: {f.name} ({f.value / used_us:.0%})") for f in named)
