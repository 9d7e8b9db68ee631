"""What a wheel's turn counts, by ten turns of each wheel by hand: the board is new, and so are its counts.

A figure that nobody has measured is a wrong speed: the sketches count one edge of four, 4200 a turn is what a published
host assumes, and the motors' data give 8400 (64 edges a motor turn, 131.25:1).
"""

import time
from collections.abc import Callable, Sequence

import serial

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.flash.procedure import BAUD, HEAR_S
from chefbotd.core.record import Record

TURNS = 10
COUNTS_S = 2.0
MOST_DIFFERENCE = 0.03
"""Between the wheels: a tenth of a turn by hand is a hundredth, and wheels with unlike gears differ by more."""

WHEELS = ("left", "right")
NOT_MEASURED = (
    "What a turn of a wheel counts was not measured. The firmware counts all four edges of the encoders, four times "
    "what a sketch counts; but four times an assumed figure is assumed too (4200 is a published host's; the motors' "
    "data give 8400). Measure it before anything drives: 'chefbotctl calibrate encoders', or this command again. Then "
    'set [encoders] counts_per_turn, and counted_by = "firmware". chefbotd does not drive before.'
)


class Turned(Record, frozen=True):
    """What both encoders have counted while one wheel was turned forward: left, right."""

    counts: tuple[int, int]


def measure_turns(port: SerialPort, ask: Callable[[str], bool]) -> list[Turned]:
    """Ask for ten turns of each wheel, and read the encoders before and after; empty where ``ask`` was answered by no.

    Raises:
        ProgramError: the port cannot be opened or read, or no counts come in.
    """
    turned: list[Turned] = []
    if not ask(f"Now measure what a turn counts, by {TURNS} turns of each wheel by hand: ready?"):
        return turned
    try:
        with serial.Serial(port.device, BAUD, timeout=0.2, exclusive=True) as line:
            read_counts(line, HEAR_S)  # opening the port may have restarted the board
            for wheel in WHEELS:
                if not ask(f"Mark where the {wheel} wheel stands, and leave both wheels alone: ready?"):
                    return []
                before = read_counts(line, COUNTS_S)
                if not ask(
                    f"Turn the {wheel} wheel forward by hand, {TURNS} whole turns, back to its mark: done?"
                ):
                    return []
                after = read_counts(line, COUNTS_S)
                turned.append(Turned((after[0] - before[0], after[1] - before[1])))
    except (OSError, serial.SerialException) as error:
        raise ProgramError(Exit.FAILED, f"{port.device}: its counts cannot be read: {error}") from error
    return turned


def read_counts(line: serial.Serial, for_s: float) -> tuple[int, int]:
    """The newest counts of both encoders.

    Raises:
        ProgramError: none come in within ``for_s``.
    """
    line.reset_input_buffer()
    until_s, pending, is_first = time.monotonic() + for_s, b"", True
    while time.monotonic() < until_s:
        *lines, pending = (pending + line.read(max(line.in_waiting, 1))).split(b"\n")
        for text in lines:
            counts = None if is_first else counts_in(text.strip())
            is_first = False  # it may be the end of a line
            if counts is not None:
                return counts
    raise ProgramError(Exit.FAILED, f"{line.port}: no encoder counts came in within {for_s:.0f} s")


def counts_in(text: bytes) -> tuple[int, int] | None:
    """The counts in a board's `e` line of either mode; None in any other."""
    kind, *fields = text.split(b"\t")
    try:
        return (int(fields[0]), int(fields[1])) if kind == b"e" else None
    except (IndexError, ValueError):
        return None


def judge_turns(turned: Sequence[Turned]) -> tuple[int | None, str]:
    """The counts of a turn, None where they cannot be told, and what to set or to mend."""
    if not turned:
        return None, NOT_MEASURED
    for index, wheel in enumerate(WHEELS):
        if problem := _problem(wheel, turned[index].counts[index], turned[index].counts[1 - index]):
            return None, f"{problem} Mend that, and run this command again: chefbotd does not drive before."
    left, right = turned[0].counts[0], turned[1].counts[1]
    figures = f"{TURNS} turns by hand counted {left} on the left and {right} on the right"
    if abs(left - right) > MOST_DIFFERENCE * max(left, right):
        return None, (
            f"{figures}: they differ by more than {MOST_DIFFERENCE:.0%}. Was a turn missed? Run this command again; "
            "chefbotd does not drive before."
        )
    counts = round((left + right) / 2 / TURNS)
    return counts, (
        f'Set [encoders] counts_per_turn = {counts} and counted_by = "firmware". This rests on what you turned: '
        f"{figures}. chefbotd does not drive before."
    )


def _problem(wheel: str, own: int, other: int) -> str:
    if abs(other) > abs(own):
        return (
            f"The {wheel} wheel's turns were counted by the other wheel's encoder ({other}, its own: {own}): exchange "
            "their plugs."
        )
    if abs(own) < TURNS:
        return f"The {wheel} wheel's turns were not counted ({own}): see its encoder's wires."
    if own < 0:
        return (
            f"The {wheel} wheel was counted backwards ({own}): exchange its encoder's two channels, unless it was "
            "turned back."
        )
    return ""
