"""What the daemon costs at a 100 Hz board cycle with one subscriber, and where that goes.

The robot drives, commanded ten times a second, and one client takes every event of ``odometry`` and ``wheels``: on the
lean board, then on ``chefbotd simulate``, then on the lean board again with stopwatches in the daemon.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
    seconds = SECONDS / 4 if quick else SECONDS
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        instrument.start(1 / CYCLE_HZ)
        cores, hz = load(running, caller, seconds)
        resident_mb = running.resident_mb()
    with _simulated_board() as device, daemon(device) as running, connect(running) as caller:
        simulated_cores, simulated_hz = load(running, caller, seconds)
    figures = (
        Figure("daemon at 100 Hz", cores, "core", 0.04, "0.27-0.35"),
        Figure("daemon at 100 Hz, on chefbotd simulate", simulated_cores, "core", 0.04),
        Figure("resident memory", resident_mb, "MB", 90.0, "368"),
        *_by_part(seconds),
    )
    remark = f"the lean board made {hz:.1f} cycles/s, chefbotd simulate {simulated_hz:.1f}: it waits for its echoes"
    return Outcome(figures, remarks=(remark,))


def load(running: Daemon, caller: Caller, seconds: float) -> tuple[float, float]:
    """Processor seconds of the daemon per second, and the cycles per second that reached the subscriber."""
    caller.call("subscribe", topics=TOPICS, policy="ordered")
    caller.drive_for(1.0, *TWIST)
    began_s, before_s = time.monotonic(), running.cpu_s()
    lines = caller.drive_for(seconds, *TWIST)
    elapsed_s = time.monotonic() - began_s
    return (running.cpu_s() - before_s) / elapsed_s, lines / len(TOPICS) / elapsed_s


@contextmanager
def _simulated_board() -> Iterator[str]:
    command = [*CHEFBOTD, "simulate", "--cycle-hz", str(CYCLE_HZ)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def _by_part(seconds: float) -> tuple[Figure, ...]:
    """Microseconds per cycle and the share of the whole, from a daemon with stopwatches."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-bench-") as folder:
        report = Path(folder, "parts.json")
        program = [sys.executable, "-m", "benchmarks.stopwatch", str(report)]
        with (
            board() as instrument,
            daemon(instrument.device, program=program) as running,
            connect(running) as caller,
        ):
            started_s = running.cpu_s()
            instrument.start(1 / CYCLE_HZ)
            load(running, caller, seconds)
            used_s, cycles = running.cpu_s() - started_s, instrument.collect().sent["e"]
        parts: dict[str, float] = json.loads(report.read_text())
    parts["loop, system calls, services"] = used_s - sum(parts.values())
    return tuple(
        Figure(f"a cycle: {part} ({took_s / used_s:.0%})", took_s / cycles * 1e6, "us")
        for part, took_s in sorted(parts.items(), key=lambda each: -each[1])
    )
