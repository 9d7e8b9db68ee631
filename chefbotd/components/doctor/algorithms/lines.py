"""Checks of the board's lines: whether they arrive, how many are damaged, and the drift of its clock."""

from collections.abc import Mapping

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.core.record import Record

GARBLED_SHARE = 0.1
"""The share of bytes that are not text above which the baud rate is wrong."""

DAMAGED_SHARE, MUCH_DAMAGED_SHARE = 0.01, 0.1
"""A share of all lines. A good cable damages none in hours."""

DRIFT_PPM = 2000.0
"""A ceramic resonator is good for 5000, a crystal for 100 (assumed); the daemon follows what there is."""

LEAST_CLOCK_S = 2.0
"""A shorter span shows the jitter of the reads rather than the drift."""

AT_REST_RAD = 0.05

NAMES = {
    "t": "time",
    "e": "encoders",
    "u": "ultrasonic",
    "s": "duty echo",
    "i": "IMU",
    "b": "battery",
    "a": "analogue input",
    "q": "encoder edges",
}


class LinesHeard(Record, frozen=True):
    """What came in ``seconds`` from a board's port.

    ``kinds`` counts good lines by their first letter, ``rates_hz`` tells how often each came, ``damaged`` counts the
    others by reason (``example`` is one of them). ``texts`` are the lines of text, oldest first. ``wire`` is the variant
    that fits best and ``wheels`` how many it has. ``clock_ppm`` is how much faster than ours the board's clock runs,
    over ``clock_s``. ``duty`` is the last echo, ``counted`` how far each encoder went. ``firmware`` is the version of
    our own firmware, where the board has named it or sends checked lines (``?`` then). ``formats`` has a sentence about
    each kind that is always refused, none of whose lines count as damaged; ``clock_unit`` one about a clock that counts
    something else than microseconds. ``analogue`` is the highest reading of each analogue input, ``battery`` that of the
    battery's.
    """

    seconds: float
    bytes: int = 0
    garbled_share: float = 0.0
    sample: str = ""
    kinds: Mapping[str, int] = {}
    rates_hz: Mapping[str, float] = {}
    damaged: Mapping[str, int] = {}
    example: str = ""
    texts: tuple[str, ...] = ()
    wire: str = ""
    wheels: int = 0
    raw_imu: bool = False
    clock_ppm: float | None = None
    clock_s: float = 0.0
    duty: tuple[float, ...] = ()
    counted: tuple[int, ...] = ()
    firmware: str = ""
    formats: Mapping[str, str] = {}
    clock_unit: str = ""
    analogue: Mapping[int, float] = {}
    battery: float | None = None

    def sends(self, kind: str) -> bool:
        """Whether lines of this kind come, be they understood or not."""
        return kind in self.kinds or kind in self.formats

    @property
    def frames(self) -> int:
        """Good lines that are no text."""
        return sum(self.kinds.values())

    @property
    def is_board(self) -> bool:
        """Whether a board sends: hardly a line of another device has a meaning."""
        lines = self.frames + sum(self.damaged.values())
        return self.frames > 0 and self.frames >= MUCH_DAMAGED_SHARE * lines

    @property
    def is_garbled(self) -> bool:
        """Whether the bytes are not text, as at a wrong baud rate."""
        return self.bytes > 0 and self.garbled_share > GARBLED_SHARE and not self.is_board

    @property
    def cycle_hz(self) -> float | None:
        """The rate of the board's cycle, by its encoder lines."""
        return self.rates_hz.get("e") or self.rates_hz.get("t")


def check_heard(heard: LinesHeard) -> Finding:
    """Whether a board sends lines, and how often each kind comes."""
    if not heard.bytes:
        return problem(
            "lines",
            f"nothing was received for {heard.seconds:.1f} s",
            "is the board powered (its LED), does its sketch run, and is this its port? Press its reset button once",
        )
    if heard.is_garbled:
        share = f"{heard.garbled_share:.0%} of {heard.bytes} bytes are not text"
        return problem("lines", f"{share}: {heard.sample}", "the baud rate is wrong: see above")
    if not heard.is_board and not heard.formats:
        return problem(
            "lines",
            f"text was received, but hardly any valid line of a board: {heard.sample}",
            "this is the port of another device: 'chefbotctl ports --listen' finds the board",
        )
    text = ", ".join(
        f"{letter} ({NAMES[letter]}) {heard.rates_hz.get(letter, 0.0):.1f} a second"
        for letter in heard.kinds
        if letter in NAMES
    )
    if "e" in heard.formats:
        return problem(
            "lines", f"no encoder line is understood; heard: {text or 'nothing else'}", "see the next finding"
        )
    if not heard.kinds.get("e") and not heard.kinds.get("q"):
        return problem(
            "lines",
            f"no encoder lines; heard: {text}",
            "without encoders the robot cannot be driven: load the right sketch",
        )
    return ok("lines", f"heard: {text}")


def check_formats(heard: LinesHeard) -> list[Finding]:
    """Each kind of line that the board writes in another format."""
    return [
        problem(
            f"line_format {kind}",
            sentence,
            f"change how the board's program prints its {kind!r} lines ({NAMES.get(kind, 'other')}); the cable is good",
        )
        for kind, sentence in heard.formats.items()
    ]


def check_damaged(heard: LinesHeard) -> Finding:
    """How many lines are damaged, and how."""
    if not heard.is_board:
        return skip_check("damaged_lines", "nothing was received from a board")
    bad = sum(heard.damaged.values())
    share = bad / (heard.frames + bad)
    if not bad:
        return ok("damaged_lines", f"none of {heard.frames} lines is damaged")
    reasons = ", ".join(f"{n} {reason.replace('_', ' ')}" for reason, n in heard.damaged.items())
    text = (
        f"{bad} of {heard.frames + bad} lines are damaged ({share:.1%}: {reasons}), such as {heard.example!r}"
    )
    if share < DAMAGED_SHARE:
        return ok("damaged_lines", text)
    advice = (
        "try another USB cable, shorter and with a ferrite; keep it away from the motors' wires, and plug it straight "
        "into the computer, not into a hub"
    )
    return (problem if share >= MUCH_DAMAGED_SHARE else warning)("damaged_lines", text, advice)


def check_clock(heard: LinesHeard) -> Finding:
    """Whether the board's clock keeps time with ours."""
    if not heard.is_board:
        return skip_check("board_clock", "nothing was received from a board")
    if "t" not in heard.kinds:
        return ok("board_clock", "the board sends no time (no 't' lines), so the daemon uses its own clock")
    if heard.clock_unit:
        return problem("board_clock", heard.clock_unit, "mend the board's program: 't' begins with micros()")
    if heard.clock_ppm is None or heard.clock_s < LEAST_CLOCK_S:
        return skip_check(
            "board_clock",
            "the 't' lines are too few or too irregular to compare the clocks",
            "listen longer: --seconds 20",
        )
    direction = "fast" if heard.clock_ppm > 0 else "slow"
    text = f"the board's clock is {abs(heard.clock_ppm):.0f} ppm {direction} over {heard.clock_s:.1f} s"
    if abs(heard.clock_ppm) <= DRIFT_PPM:
        return ok("board_clock", text)
    return warning(
        "board_clock",
        text,
        "the daemon follows it, but speeds are wrong by as much: is the sketch built for this board's frequency?",
    )


def check_left_on(duty: tuple[float, ...]) -> list[Finding]:
    """Whether motors were on when the port was opened; without a daemon, the program that drove them has died."""
    if not any(duty):
        return []
    duties = " ".join(f"{value:g}" for value in duty)
    return [
        problem(
            "motors_left_on",
            f"the motors were on (s {duties}) although no daemon is running",
            "keep clear; the last program that drove the robot did not stop it: "
            "'journalctl -u chefbotd -n 50' may say why",
        )
    ]


def check_at_rest(heard: LinesHeard, counts_per_turn: float) -> Finding:
    """Whether the motors are off and the wheels stand while nobody drives."""
    if not heard.is_board:
        return skip_check("at_rest", "nothing was received from a board")
    if any(heard.duty):
        values = " ".join(f"{duty:g}" for duty in heard.duty)
        return problem(
            "at_rest",
            f"the board says that its motors are on (s {values}), although nothing commanded them",
            "keep clear of the wheels; 'chefbotctl estop', or cut the motors' power",
        )
    turned = [abs(count) / counts_per_turn * 6.283 for count in heard.counted]
    if any(angle_rad > AT_REST_RAD for angle_rad in turned):
        values = ", ".join(f"{count:+d}" for count in heard.counted)
        text = f"the encoders counted {values} while nobody drove"
        advice = "was the robot moved? If not, an encoder's wire is loose or picks up noise"
        if not heard.sends("s"):
            text += "; the board sends no 's' lines, so whether its motors are on is not known"
            advice = f"keep clear and look whether a wheel turns: then cut the motors' power. Else: {advice}"
        return warning("at_rest", text, advice)
    if not heard.sends("s"):
        return ok(
            "at_rest", "the wheels stand still; without 's' lines it is not known whether the motors are off"
        )
    return ok("at_rest", "the motors are off, and the wheels stand still")
