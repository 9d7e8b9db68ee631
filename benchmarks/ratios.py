"""What chefbotd costs as a ratio to the floor (``benchmarks/floor.py``), both measured by turns in one run.

A ratio says more than a time: a busy machine slows both sides, and a faster one speeds both up. Each round measures the
floor and then the daemon; each figure is the ratio of the two medians over the rounds.
"""

import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

from benchmarks import latency, start
from benchmarks.board import board
from benchmarks.cpu import load
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.rig import CHEFBOTD, connect, daemon

C = TypeVar("C")
FLOOR = (sys.executable, "-m", "benchmarks.floor")
ROUNDS = 5
CPU_S = 6.0
CYCLE_HZ = 100
COMMANDS = 60
FRAMES = 400


@dataclass(frozen=True, slots=True)
class Cost:
    """What one program costs, measured once."""

    cores: float
    frame_to_answer_s: float
    drive_to_wire_s: float
    first_stop_s: float
    armed_s: float
    resident_mb: float


TARGETS: dict[str, tuple[str, float]] = {
    "cores": ("CPU at 100 Hz, over the floor's", 2.2),
    "frame_to_answer_s": ("encoders to s, p50, over the floor's", 1.4),
    "drive_to_wire_s": ("drive to s, p50, over the floor's", 1.3),
    "first_stop_s": ("start to first s, over the floor's", 0.6),
    "armed_s": ("start to armed, over the floor's", 4.0),
}
RESIDENT_MB = 42.0


def run(*, quick: bool = False) -> Outcome:
    """The ratios with their targets, and what the floor itself was measured at."""
    floor, ours = by_turns(1 if quick else ROUNDS, lambda: measure(FLOOR), lambda: measure(CHEFBOTD))
    ratios = [
        Figure(name, median(ours, field) / median(floor, field), "x", target)
        for field, (name, target) in TARGETS.items()
    ]
    resident = Figure("resident memory", median(ours, "resident_mb"), "MB", RESIDENT_MB)
    remarks = tuple(
        f"{field.name}: floor {median(floor, field.name):.4g}, chefbotd {median(ours, field.name):.4g}"
        for field in fields(Cost)
    )
    return Outcome((*ratios, resident), remarks=remarks)


def by_turns(rounds: int, first: Callable[[], C], second: Callable[[], C]) -> tuple[list[C], list[C]]:
    """Measure one after the other, so many times: what disturbs a round disturbs both."""
    pairs = [(first(), second()) for _ in range(rounds)]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def median(costs: Sequence[object], field: str) -> float:
    """The median of one figure over the rounds."""
    return statistics.median([float(getattr(cost, field)) for cost in costs])


def measure(program: Sequence[str]) -> Cost:
    """Every figure of one program, once."""
    begun = start.start(program)
    with (
        board() as instrument,
        daemon(instrument.device, program=program) as running,
        connect(running) as caller,
    ):
        instrument.start(latency.CYCLE_S, echo_s=latency.ECHO_S)
        to_wire_s, _ = latency.command_to_wire(instrument, caller, COMMANDS)
        instrument.start(1 / CYCLE_HZ, echo_s=latency.ECHO_S)
        answers_s = latency.frame_to_answer(instrument, caller, FRAMES / CYCLE_HZ)
        instrument.start(1 / CYCLE_HZ)
        cores, _ = load(running, caller, CPU_S)
        resident_mb = running.resident_mb()
    return Cost(
        cores,
        percentile(answers_s, 50),
        percentile(to_wire_s, 50),
        begun.first_stop_s,
        begun.armed_s,
        resident_mb,
    )
