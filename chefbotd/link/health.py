"""Whether what comes in is a board at all: an open port says little, a wrong one says something else.

A board that talks is judged by the share of its lines that are frames; a line in ten is plenty on the worst cable, and
no other device comes near it. At a wrong baud rate most bytes are not text.
"""

from enum import StrEnum

from msgspec import field

from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.link.firmware_state import LineQuality
from chefbotd.link.line_format import FormatWatch, TimeUnitWatch, has_other_separator, kinds_of
from firmware_protocol.codec import Variant
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import Malformed, Text

ENOUGH_LINES = 20
LEAST_FRAME_SHARE = 0.1
GARBLED_SHARE = 0.1
SHOWN_BYTES = 64


class Condition(StrEnum):
    """What an open port turned out to be."""

    HEALTHY = "healthy"
    SILENT = "silent"
    WRONG_BAUD = "wrong_baud"
    WRONG_DEVICE = "wrong_device"
    ECHO_STUCK = "echo_stuck"
    NOT_NEGOTIATED = "not_negotiated"
    COUNTS_DIFFER = "counts_differ"
    LINES_REFUSED = "lines_refused"
    WRONG_TIME_UNIT = "wrong_time_unit"
    SHARED_PORT = "shared_port"


ONLY_HEALTHY = frozenset({Condition.HEALTHY})
_EXPLAINED = {
    Condition.LINES_REFUSED: frozenset({Condition.HEALTHY, Condition.WRONG_DEVICE}),
    Condition.SHARED_PORT: frozenset(Condition),
}
"""What a complaint is said in the place of, where that is more than a healthy link.

Where all kinds of lines are refused, no frame comes at all, and of a port that is read by two there may come nothing.
"""


class Heard(Record, frozen=True):
    """Totals since the daemon started: bytes, lines of any kind, and those of them that were frames."""

    bytes: int = 0
    lines: int = 0
    frames: int = 0

    def since(self, before: "Heard") -> "Heard":
        """What was heard after ``before``."""
        return Heard(self.bytes - before.bytes, self.lines - before.lines, self.frames - before.frames)


class LinkHealth(Record, frozen=True):
    """The condition, and for people what was heard and what it suggests (empty while healthy)."""

    condition: Condition
    reason: str


class HealthWatch(MutableState):
    """Judges one connection from ``from_s`` on; look at it a few times a second."""

    from_s: float
    before: Heard
    _reported: Condition | None = field(default=None, name="_told")

    def look(
        self,
        now_s: float,
        heard: Heard,
        sample: bytes,
        complaint: LinkHealth | None = None,
        *,
        health_after_s: float,
    ) -> LinkHealth | None:
        """The health if it has changed; ``sample`` are the newest bytes, ``complaint`` what else is wrong with a board.

        It is judged as soon as there are lines enough, or after ``health_after_s`` by what there is.
        """
        new, waited_s = heard.since(self.before), now_s - self.from_s
        if new.lines < ENOUGH_LINES and waited_s < health_after_s:
            return None
        self.from_s, self.before = now_s, heard
        health = _judge(new, waited_s, sample)
        if complaint is not None and health.condition in _EXPLAINED.get(complaint.condition, ONLY_HEALTHY):
            health = complaint
        if health.condition is self._reported:
            return None
        self._reported = health.condition
        return health


def _judge(new: Heard, waited_s: float, sample: bytes) -> LinkHealth:
    if not new.bytes:
        reason = Sentence(
            "board.silent",
            "nothing received for {seconds:.1f} s: is the board powered, and does its program run?",
            seconds=waited_s,
        )
        return LinkHealth(Condition.SILENT, reason)
    if new.frames and new.frames >= LEAST_FRAME_SHARE * new.lines:
        return LinkHealth(Condition.HEALTHY, "")
    received = Sentence(
        "board.received",
        "{bytes} bytes, {lines} lines, {frames} of them frames; received: {sample}",
        bytes=new.bytes,
        lines=new.lines,
        frames=new.frames,
        sample=show(sample),
    )
    if has_other_separator(sample):
        return LinkHealth(
            Condition.LINES_REFUSED,
            Sentence(
                "board.other_separator",
                "the lines look like a board's, but their fields are not separated by one TAB each: {received}",
                received=received,
            ),
        )
    if _garbled_share(sample) > GARBLED_SHARE:
        return LinkHealth(
            Condition.WRONG_BAUD,
            Sentence(
                "board.wrong_baud",
                "mostly bytes that are no text: is the baud rate right? {received}",
                received=received,
            ),
        )
    return LinkHealth(
        Condition.WRONG_DEVICE,
        Sentence(
            "board.wrong_device",
            "text without frames: is this the board's port? {received}",
            received=received,
        ),
    )


def _garbled_share(sample: bytes) -> float:
    text = sum(0x20 <= byte <= 0x7E or byte in b"\t\r\n" for byte in sample)
    return 1 - text / len(sample)


def show(line: bytes) -> str:
    """Bytes for people: printable ASCII on one line, at most ``SHOWN_BYTES`` of them."""
    shown = "".join(chr(byte) if 0x20 <= byte <= 0x7E else f"\\x{byte:02x}" for byte in line[:SHOWN_BYTES])
    shown = shown.replace("\\x09", "\\t").replace("\\x0d", "\\r").replace("\\x0a", "\\n")
    return shown + ("..." if len(line) > SHOWN_BYTES else "")


SAMPLE_BYTES = 128


class LinkMonitorState(MutableState):
    """What has come in since the start, and what was judged of it; ``opened`` is what there was when the port was."""

    opened: Heard
    watch: HealthWatch
    bytes_in: int = 0
    sample: bytes = b""
    opened_s: float = 0.0
    damaged_before: int = 0
    formats: FormatWatch = field(default_factory=FormatWatch)
    time_unit: TimeUnitWatch = field(default_factory=TimeUnitWatch)
    sharers: str = ""


class LinkMonitor(StatefulPart[LinkMonitorState]):
    """Listens beside the decoder, which has seen the same bytes."""

    def __init__(self, decoder: Decoder, variant: Variant, *, health_after_s: float) -> None:
        self._decoder, self._judged_after_s = decoder, health_after_s
        self._kinds = kinds_of(variant)
        self._kind_names = frozenset(self._kinds)
        self.memory = LinkMonitorState(Heard(), HealthWatch(0.0, Heard()))

    def begin(self, now_s: float) -> None:
        """A port was opened: nothing is known of it yet."""
        memory = self.memory
        memory.opened_s, memory.damaged_before = now_s, self._decoder.malformed.total()
        memory.opened = self._heard()
        memory.watch, memory.formats = HealthWatch(now_s, memory.opened), FormatWatch()
        memory.time_unit.begin()

    def count_bytes(self, data: bytes) -> None:
        """Bytes that have come in."""
        self.memory.bytes_in += len(data)
        self.memory.sample = (self.memory.sample + data)[-SAMPLE_BYTES:]

    def quality(self, now_s: float) -> LineQuality:
        """How whole the lines have come since the port was opened."""
        refused = self._decoder.malformed.total() - self.memory.damaged_before
        return LineQuality(
            now_s - self.memory.opened_s, self._heard().since(self.memory.opened).lines, refused
        )

    def note_refused(self, line: Malformed) -> None:
        """A line was refused."""
        self.memory.formats.note_refused(line, show(line.line), self._kind_names, self._accepted_of)

    def _accepted_of(self, kind: str) -> int:
        accepted = self._decoder.accepted
        return sum(accepted.get(name, 0) for name in self._kinds[kind])

    def shared_complaint(self) -> LinkHealth | None:
        """Who else has the port open, as a complaint."""
        return LinkHealth(Condition.SHARED_PORT, self.memory.sharers) if self.memory.sharers else None

    def format_complaint(self, clock: tuple[int, float] | None) -> LinkHealth | None:
        """What is wrong with how the board writes; ``clock`` is its newest reading (us) and when it was read."""
        if clock is not None:
            self.memory.time_unit.observe(*clock)
        if unit := self.memory.time_unit.complaint:
            return LinkHealth(Condition.WRONG_TIME_UNIT, unit)
        if refused := self.memory.formats.refused_kind(self._accepted_of):
            return LinkHealth(Condition.LINES_REFUSED, refused)
        return None

    @property
    def proven(self) -> bool:
        """Whether a frame has come in since the port was opened."""
        return self._heard().since(self.memory.opened).frames > 0

    def judge(self, now_s: float, complaint: LinkHealth | None = None) -> LinkHealth | None:
        """What the port sounds like, if that has changed; ``complaint``: what else is wrong with a board."""
        return self.memory.watch.look(
            now_s, self._heard(), self.memory.sample, complaint, health_after_s=self._judged_after_s
        )

    def _heard(self) -> Heard:
        frames, refused = self._decoder.accepted, self._decoder.malformed.total()
        lines = sum(frames.values())
        return Heard(self.memory.bytes_in, lines + refused, lines - frames.get(Text.__name__, 0))
