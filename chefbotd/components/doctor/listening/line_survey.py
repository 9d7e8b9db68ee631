"""Summarizes a board's port for people: the kinds of line, their rates, damaged lines, and the protocol variant."""

import math
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any

from chefbotd.components.doctor.algorithms.lines import LinesHeard
from chefbotd.link.health import show
from chefbotd.link.line_format import FormatWatch, TimeUnitWatch, describe_refused, kinds_of
from firmware_protocol import messages as wire
from firmware_protocol.checked import FirmwareCodec, unseal
from firmware_protocol.codec import VARIANTS, Variant
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import Reason

LETTERS: Mapping[type[Any], str] = {
    wire.BoardTime: "t",
    wire.EncoderCounts: "e",
    wire.UltrasonicDistance: "u",
    wire.DutyEcho: "s",
    wire.SequencedEcho: "s",
    wire.AgedDistance: "u",
    wire.AgedImu: "i",
    wire.Orientation: "i",
    wire.RawImu: "i",
    wire.BatteryLevel: "b",
    wire.AnalogueLevel: "a",
    wire.QuadratureEdges: "q",
    wire.QuadratureStill: "q",
}
ORDER = "teusibaq"
"""In the order of a cycle."""

UNNAMED = "?"
"""Our firmware's version, where only its checked lines were heard."""

FEWEST_REFUSED = 10
"""So many lines of a kind, and not a good one among them: half a second of a board's."""

TEXTS_KEPT, SAMPLE_BYTES = 20, 48
UNSTEADY_PPM = 3000.0
MICROS_SPAN = 1 << 32
LONGEST_STEP_US = 10_000_000
TEXT_BYTES = frozenset((*range(0x20, 0x7F), *b"\t\r\n"))


class _LineListener:
    """Decodes what is received as one variant of the protocol."""

    def __init__(self, variant: Variant) -> None:
        self.variant = variant
        self.decoder = Decoder(FirmwareCodec(variant))
        self.decoder.reset()  # the first line is usually half a line
        self.kinds: Counter[str] = Counter()
        self.first_s: dict[str, float] = {}
        self.last_s: dict[str, float] = {}
        self.texts: deque[str] = deque(maxlen=TEXTS_KEPT)
        self.example = ""
        self.formats = FormatWatch()
        self._kind_names = frozenset(kinds_of(variant))
        self.raw_imu = False
        self.firmware = ""
        self.duty: tuple[float, ...] = ()
        self.first_counts: tuple[int, ...] = ()
        self.counts: tuple[int, ...] = ()
        self.clock: list[tuple[float, float]] = []
        self.analogue: dict[int, float] = {}
        self.battery: float | None = None
        self._micros: int | None = None

    def feed(self, data: bytes, now_s: float) -> None:
        for line, message in self.decoder.feed(data):
            letter = LETTERS.get(type(message))
            if letter is not None:
                self.kinds[letter] += 1
                self.first_s.setdefault(letter, now_s)
                self.last_s[letter] = now_s
            self._take_line(line, message, now_s)

    def _take_line(self, line: bytes, message: object, now_s: float) -> None:
        match message:
            case wire.BoardTime(micros=micros):
                self._tick(micros, now_s)
            case wire.EncoderCounts(counts=counts):
                self.first_counts, self.counts = self.first_counts or counts, counts
            case wire.DutyEcho(duty=duty):
                self.duty = duty
            case wire.SequencedEcho(duty=duty):
                self.duty, self.firmware = duty, self.firmware or UNNAMED
            case wire.Firmware(major=major, minor=minor):
                self.firmware = f"{major}.{minor}"
            case wire.AnalogueLevel(channel=channel, adc=adc):
                self.analogue[channel] = max(adc, self.analogue.get(channel, 0.0))
            case wire.BatteryLevel(adc=adc):
                self.battery = max(adc, self.battery or 0.0)
            case wire.RawImu() | wire.AgedImu():
                self.raw_imu = True
            case wire.Text(text=text) | wire.Banner(text=text):
                self.texts.append(text)
            case wire.Malformed() as malformed:
                self.example = self.example or show(line)
                self.formats.note_refused(malformed, show(line), self._kind_names, self.kinds.__getitem__)

    def _tick(self, micros: int, now_s: float) -> None:
        """The board's seconds beside ours; a restart, or a damaged line, begins anew."""
        if self._micros is None:
            self._micros, self.clock = micros, [(0.0, now_s)]
            return
        step = (micros - self._micros) % MICROS_SPAN
        self._micros = micros
        if step > LONGEST_STEP_US:
            self.clock = [(0.0, now_s)]
        else:
            self.clock.append((self.clock[-1][0] + step * 1e-6, now_s))

    def refused_kinds(self) -> dict[str, str]:
        """A sentence about each kind none of whose lines was understood."""
        return {
            kind: describe_refused(kind, refusals.refused, refusals.detail, refusals.example)
            for kind, refusals in self.formats.refusals().items()
            if not self.kinds[kind] and refusals.refused >= FEWEST_REFUSED
        }

    def damaged(self) -> dict[str, int]:
        """How many lines were refused for each reason, without those of refused kinds."""
        counts = Counter(self.decoder.malformed)
        for kind in self.refused_kinds():
            refusals = self.formats.refusals()[kind]
            counts[Reason(refusals.reason)] -= refusals.refused
        return {str(reason): n for reason, n in counts.items() if n > 0}

    def rate_hz(self, letter: str) -> float:
        """The time between the first and the last reading."""
        span_s = self.last_s[letter] - self.first_s[letter]
        return (self.kinds[letter] - 1) / span_s if span_s > 0 else 0.0


class LineSurvey:
    """Decodes bytes as every variant; ``heard`` sums up. If two fit equally well, the ``configured`` one wins."""

    def __init__(self, configured: str, now_s: float) -> None:
        self._from_s = now_s
        names = [configured, *(name for name in VARIANTS if name != configured)]
        self._ears = [_LineListener(VARIANTS[name]) for name in names]
        self._bytes = self._garbled = 0
        self._sample = b""

    def feed(self, data: bytes, now_s: float) -> None:
        """Bytes that were read."""
        self._bytes += len(data)
        self._garbled += sum(byte not in TEXT_BYTES for byte in data)
        self._sample = (self._sample + data)[-SAMPLE_BYTES:]
        for ear in self._ears:
            ear.feed(data, now_s)

    def heard(self, now_s: float) -> LinesHeard:
        """Everything so far, decoded as the variant that fits best."""
        ear = max(
            self._ears, key=lambda candidate: candidate.kinds.total()
        )  # the first of those that are equal
        drift = _drift(ear.clock)
        return LinesHeard(
            seconds=now_s - self._from_s,
            bytes=self._bytes,
            garbled_share=self._garbled / self._bytes if self._bytes else 0.0,
            sample=show(self._sample),
            kinds={letter: ear.kinds[letter] for letter in ORDER if letter in ear.kinds},
            rates_hz={letter: ear.rate_hz(letter) for letter in ear.kinds},
            damaged=ear.damaged(),
            example=ear.example,
            texts=tuple(ear.texts),
            wire=ear.variant.name,
            wheels=ear.variant.wheels if ear.kinds else 0,
            raw_imu=ear.raw_imu,
            clock_ppm=drift,
            clock_s=ear.clock[-1][1] - ear.clock[0][1] if ear.clock else 0.0,
            duty=ear.duty,
            counted=_between(ear.first_counts, ear.counts),
            firmware=ear.firmware,
            formats=ear.refused_kinds(),
            clock_unit=_clock_unit(ear.clock),
            analogue=ear.analogue,
            battery=ear.battery,
        )


def _between(first: tuple[int, ...], last: tuple[int, ...]) -> tuple[int, ...]:
    return tuple([after - before for before, after in zip(first, last, strict=True)])


def _clock_unit(clock: list[tuple[float, float]]) -> str:
    """A sentence about a board's clock that does not count microseconds; empty where it does, or cannot be told."""
    watch = TimeUnitWatch()
    for board_s, host_s in clock:
        watch.observe(round(board_s * 1e6) % MICROS_SPAN, host_s)
    return watch.complaint or ""


def _drift(clock: list[tuple[float, float]]) -> float | None:
    """How much faster the board's clock runs, in parts per million, by the least delayed readings of each third.

    A busy computer reads late and never early. None if the thirds do not agree: the computer was too busy.
    """
    third = len(clock) // 3
    if third < 1:
        return None
    parts = clock[:third], clock[third:-third], clock[-third:]
    first, middle, last = (min(part, key=lambda sample: sample[1] - sample[0]) for part in parts)
    early, late = _apart_ppm(first, middle), _apart_ppm(middle, last)
    return _apart_ppm(first, last) if abs(late - early) <= UNSTEADY_PPM else None


def _apart_ppm(first: tuple[float, float], last: tuple[float, float]) -> float:
    board_s, host_s = last[0] - first[0], last[1] - first[1]
    return (board_s / host_s - 1.0) * 1e6 if host_s > 0 else math.inf


def line_bytes(shown: str) -> bytes:
    r"""The bytes of a line as the topic ``raw`` shows it (``\xNN`` beyond ASCII), with its end."""
    return (
        shown.encode("ascii", "backslashreplace").decode("unicode_escape").encode("latin-1", "replace")
        + b"\n"
    )


def echo_delays_s(lines: list[tuple[float, bool, bytes]], wheels: int) -> list[float]:
    """The delays from each new motor command to its first echo. Lines have a time and a direction (to the board)."""
    delays: list[float] = []
    waiting: tuple[float, tuple[int, ...]] | None = None
    last: tuple[int, ...] = ()
    for stamp_s, outward, line in lines:
        duty = _duty(line, wheels)
        if duty is None:
            continue
        if outward and duty != last:
            waiting, last = (stamp_s, duty), duty
        elif not outward and waiting is not None and duty == waiting[1]:
            delays.append(stamp_s - waiting[0])
            waiting = None
    return delays


def _duty(line: bytes, wheels: int) -> tuple[int, ...] | None:
    """The duties of an ``s`` line in either direction, checked or not; None if the line is another one."""
    line = line.rstrip(b"\r\n")
    unsealed = unseal(line, b"\t") or unseal(line, b" ")
    kind, *fields = (line if unsealed is None else unsealed[0]).split() or [b""]
    if unsealed is not None:
        fields = fields[:wheels]  # the echo has the number of the command, too
    if kind != b"s" or len(fields) != wheels:
        return None
    try:
        return tuple([round(float(field)) for field in fields])
    except ValueError:
        return None
