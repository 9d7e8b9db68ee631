"""From the start of the daemon's process to the first stop on the wire, and to an armed robot.

The board's device is there already. The first stop is written before the daemon imports what it runs by.
"""

import compileall
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import benchmarks
import chefbotd
import firmware_protocol
from benchmarks.board import board
from benchmarks.figures import Figure, Outcome
from benchmarks.rig import CHEFBOTD, connect, daemon, until

RUNS = 7


@dataclass(frozen=True, slots=True)
class Start:
    """How long one start took: until the board had read a stop, and until the robot was armed."""

    first_stop_s: float
    armed_s: float


def run(*, quick: bool = False) -> Outcome:
    """Median and worst of several starts."""
    starts = [start() for _ in range(3 if quick else RUNS)]
    stops_s, armed_s = [each.first_stop_s for each in starts], [each.armed_s for each in starts]
    return Outcome(
        (
            Figure("start to first stop, median", statistics.median(stops_s), "s", 0.1),
            Figure(f"start to first stop, worst of {len(starts)}", max(stops_s), "s", 0.2),
            Figure("start to armed, median", statistics.median(armed_s), "s", 0.8, "1.6-2.1"),
            Figure(f"start to armed, worst of {len(starts)}", max(armed_s), "s", 0.8),
        )
    )


def start(program: Sequence[str] = CHEFBOTD) -> Start:
    """Start a program once, beside a board that reads what it says."""
    compile_sources()
    with board() as instrument, daemon(instrument.device, program=program) as running:
        read_ns: list[int] = []

        def spoke() -> bool:
            read_ns.extend(at_ns for at_ns, _ in instrument.collect().commands)
            return bool(read_ns)

        until(spoke, "the daemon says nothing to the board")
        with connect(running):
            armed_ns = time.monotonic_ns()
        return Start((read_ns[0] - running.started_ns) * 1e-9, (armed_ns - running.started_ns) * 1e-9)


@cache
def compile_sources() -> None:
    """Compile what is measured, as pip does when it installs; a source tree may be kept free of bytecode otherwise."""
    for package in (benchmarks, chefbotd, firmware_protocol):
        compileall.compile_dir(Path(package.__path__[0]), quiet=1)
