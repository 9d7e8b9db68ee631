"""The board's firmware (firmware/README.md): the core's host build against noise, bit errors and a load; an image.

Needs gcc and make, for the image avr-gcc and simavr; `--quick` sends a hundredth of the lines.
"""

import json
import math
import subprocess
from collections.abc import Callable
from typing import Any

from benchmarks import firmware_image
from benchmarks.figures import Figure, Outcome
from tests.firmware import load, tools

LINES = 100_000_000
QUICK_LINES = 1_000_000
SEED = 2


def noise(*, quick: bool) -> Outcome:
    """One byte in a hundred with a flipped bit: wrong motions, resets, and how many lines are obeyed."""
    tools.make("proofs")
    lines = QUICK_LINES if quick else LINES
    done = subprocess.run([tools.BUILD / "flips", str(lines), str(SEED)], capture_output=True, text=True)
    tally: dict[str, Any] = json.loads(done.stdout)
    figures = (
        Figure(f"wrong motions of {lines:.0e} lines, 1 % of bytes flipped", tally["wrong_motions"], "", 0),
        Figure("resets by that", tally["resets"], "", 0),
        Figure("lines that are not obeyed (0.22 at most: 78 % are)", 1 - tally["obeyed"], "", 0.22),
    )
    faults = (done.stderr,) if done.returncode else ()
    return Outcome(figures, faults=faults)


def bit_errors(*, quick: bool) -> Outcome:
    """All errors of one to three bits in sample lines; the same number in both forms."""
    tools.make("proofs")
    done = subprocess.run([tools.BUILD / "bit_errors"], capture_output=True, text=True)
    faults = (done.stdout,) if done.returncode else ()
    return Outcome((Figure("lines obeyed with 1 to 3 wrong bits", done.returncode, "", 0),), faults=faults)


def step_of_load(*, quick: bool) -> Outcome:
    """How far a wheel falls behind at a step of load, with the board's loop and the host's."""
    by_board, by_host = load.fall_behind(load.boards_loop()), load.fall_behind(load.hosts_loop())
    ratio = by_board.behind_mm / by_host.behind_mm if by_host.behind_mm else math.inf
    return Outcome(
        (
            Figure("behind at a step of load, host's loop", by_host.behind_mm, "mm"),
            Figure("behind at a step of load, board's loop", by_board.behind_mm, "mm"),
            Figure("board's loop to the host's", ratio, "x", 1 / 5),
        )
    )


PARTS: tuple[Callable[..., Outcome], ...] = (
    noise,
    bit_errors,
    step_of_load,
    firmware_image.stops,
    firmware_image.load,
    firmware_image.size,
)


def run(*, quick: bool) -> Outcome:
    """All parts, in one table."""
    outcomes = [part(quick=quick) for part in PARTS]
    return Outcome(
        tuple(figure for outcome in outcomes for figure in outcome.figures),
        remarks=tuple(remark for outcome in outcomes for remark in outcome.remarks),
        faults=tuple(fault for outcome in outcomes for fault in outcome.faults),
    )
