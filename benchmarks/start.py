"""From the start of the daemon's process to the first ``s`` on the wire, with the board's device already there."""

import compileall
import statistics
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import benchmarks
import chefbotd
import firmware_protocol
from benchmarks.board import board
from benchmarks.figures import Figure, Outcome
from benchmarks.rig import CHEFBOTD, daemon, until

RUNS = 7


def run(*, quick: bool = False) -> Outcome:
    """Median and worst of several starts."""
    starts_s = [start_s() for _ in range(3 if quick else RUNS)]
    return Outcome(
        (
            Figure("start to first s, median", statistics.median(starts_s), "s", 0.8, "1.6-2.1"),
            Figure(f"start to first s, worst of {len(starts_s)}", max(starts_s), "s", 0.8),
        )
    )


def start_s(program: Sequence[str] = CHEFBOTD) -> float:
    """From the start of a program's process to the first motor command that the board reads."""
    compile_sources()
    with board() as instrument, daemon(instrument.device, program=program) as running:
        read_ns: list[int] = []

        def spoke() -> bool:
            read_ns.extend(at_ns for at_ns, _ in instrument.collect().commands)
            return bool(read_ns)

        until(spoke, "the daemon says nothing to the board")
        return (read_ns[0] - running.started_ns) * 1e-9


@cache
def compile_sources() -> None:
    """Compile what is measured, as pip does when it installs; a source tree may be kept free of bytecode otherwise."""
    for package in (benchmarks, chefbotd, firmware_protocol):
        compileall.compile_dir(Path(package.__path__[0]), quiet=1)
