"""Recognizes the sketch of a board by its lines, its rate, its banner, and its number of wheels.

The rows are those of ``chefbotd.components.simulation.parameters.sketches``: what was seen of the published ones.
"""

import math
from collections.abc import Mapping

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.components.doctor.algorithms.lines import LinesHeard
from chefbotd.components.simulation.parameters.sketches import SKETCHES, SketchName, SketchParameters
from chefbotd.core.record import Record

TITLES = {
    SketchName.TIVA: "sketch A, the Tiva's with the motion processor",
    SketchName.TIVA_BARE: "sketch B, the Tiva's without IMU and ultrasonic",
    SketchName.DUEMILANOVE: "sketch C, the Arduino Duemilanove's",
    SketchName.TIVA_SECOND: "sketch D, the Tiva's of the second edition",
    SketchName.KHAN: "KHAN's, with four wheels (assumed: none is published)",
    SketchName.CHEFBOT: "our own firmware",
}
KHAN_WHEELS = 4
MAY_BE_MISSING, KHAN_MAY_MISS = frozenset("ub"), frozenset("uiba")
"""Kinds that a board with nothing wired to the pin may leave out; KHAN's are all assumed."""

LIKELY, RATE_RATIO = 0.75, 3.0


class Guess(Record, frozen=True):
    """The sketch that fits best (None: none does), how well (0 to 1), and why."""

    sketch: SketchName | None
    fit: float
    reason: str


class Expected(Record, frozen=True):
    """What the configuration assumes of the board."""

    wire: str
    wheels: int
    max_duty: int
    board_buffer_bytes: int


def recognise(heard: LinesHeard) -> Guess:
    """The published sketch that these lines are most like; our own firmware names itself."""
    if heard.firmware:
        is_named = heard.firmware != "?"
        reason = f"it says so, version {heard.firmware}" if is_named else "its lines have checksums"
        return Guess(SketchName.CHEFBOT, 1.0, reason)
    fits = {name: _fit(name, SKETCHES[name], heard) for name in TITLES if name is not SketchName.CHEFBOT}
    best = max(fits, key=lambda name: fits[name])
    reason = _reason(heard)
    return Guess(best if fits[best] >= LIKELY else None, fits[best], reason)


def check_sketch(heard: LinesHeard) -> Finding:
    """Which sketch this seems to be, and its properties."""
    if not heard.is_board:
        return skip_check("sketch", "nothing was received from a board")
    guess = recognise(heard)
    if guess.sketch is None:
        return warning(
            "sketch",
            f"none of the known sketches: {guess.reason}",
            "if you wrote it yourself, hold its lines against docs/protocol.md",
        )
    return ok(
        "sketch", f"this seems to be {TITLES[guess.sketch]} ({guess.reason}){_peculiarity(guess.sketch)}"
    )


def check_expected(heard: LinesHeard, expected: Expected) -> Finding:
    """Whether the configuration fits the sketch that was recognised."""
    guess = recognise(heard) if heard.is_board else None
    if guess is None:
        return skip_check("configured_board", "nothing was received from a board")
    if heard.wheels and heard.wheels != expected.wheels:
        return problem(
            "configured_board",
            f"the board has {heard.wheels} wheels, [robot] wire = {expected.wire!r} has {expected.wheels}",
            f"set [robot] wire = {heard.wire!r}, and describe its wheels",
        )
    if guess.sketch is None:
        return skip_check("configured_board", "the sketch could not be identified")
    row = SKETCHES[guess.sketch]
    wrong, advice = _against(row, expected, published=guess.sketch is not SketchName.KHAN)
    if wrong:
        return warning("configured_board", "; ".join(wrong), "; ".join(advice))
    return ok(
        "configured_board",
        f"the configuration fits it: {expected.wheels} wheels, full scale {expected.max_duty}, a buffer of "
        f"{expected.board_buffer_bytes} bytes",
    )


def _against(row: SketchParameters, expected: Expected, *, published: bool) -> tuple[list[str], list[str]]:
    wrong, advice = [], []
    if published and expected.max_duty != row.pwm_full_scale:
        wrong.append(
            f"the full scale of this sketch is {row.pwm_full_scale}, but [drive] max_duty is {expected.max_duty}"
        )
        advice.append(
            f"set max_duty = {row.pwm_full_scale} and scale the gains with it, or measure: 'chefbotctl doctor --motors'"
        )
    if expected.board_buffer_bytes > row.receive_buffer_bytes:
        wrong.append(
            f"its receive buffer holds {row.receive_buffer_bytes} bytes, but [link] board_buffer_bytes is "
            f"{expected.board_buffer_bytes}"
        )
        advice.append(
            f"set board_buffer_bytes = {row.receive_buffer_bytes}: "
            "when the buffer overflows, it obeys the pieces of damaged commands"
        )
    return wrong, advice


def _fit(name: SketchName, row: SketchParameters, heard: LinesHeard) -> float:
    """Kinds count most; the rate decides between those that say the same."""
    if (heard.wheels == KHAN_WHEELS) != (name is SketchName.KHAN):
        return 0.0
    said, expected = set(heard.kinds), set(row.lines)
    if "q" in said:
        said = said - {"q"} | {"e"}
    missing, further = expected - said, said - expected
    spared, costs = (KHAN_MAY_MISS, 0.05) if name is SketchName.KHAN else (MAY_BE_MISSING, 0.12)
    fit = 1.0 - 0.3 * len(further) - sum(costs if kind in spared else 0.3 for kind in missing)
    if heard.cycle_hz:
        ratio = abs(math.log(heard.cycle_hz * row.cycle_s))
        fit -= 0.25 * min(ratio / math.log(RATE_RATIO), 1.0)
    return max(fit, 0.0)


def _reason(heard: LinesHeard) -> str:
    rate = f", {heard.cycle_hz:.0f} cycles a second" if heard.cycle_hz else ""
    banner = ", a banner was printed" if any("I2C" in text or "MPU" in text for text in heard.texts) else ""
    return f"lines {' '.join(heard.kinds)}, {heard.wheels} wheels{rate}{banner}"


NOTES: Mapping[SketchName, str] = {
    SketchName.TIVA: "; a missing echo silences it for up to a second",
    SketchName.TIVA_BARE: "; it sends no time and no banner, so 'Reset Done' is the only sign of a restart",
    SketchName.DUEMILANOVE: (
        "; its reset command does not restart it, its buffer holds 63 bytes, and a duty above 255 loses its high bits"
    ),
    SketchName.TIVA_SECOND: "; it prints no banner",
}


def _peculiarity(sketch: SketchName) -> str:
    return NOTES.get(sketch, "")
