"""Decodes received bytes into lines and messages, without I/O and with a bounded buffer."""

from collections import Counter, defaultdict
from operator import call
from typing import Any, NamedTuple, TypeAlias

from firmware_protocol.line_codec import LineCodec, Regained
from firmware_protocol.lines import NUMERIC
from firmware_protocol.messages import Malformed, Message, Reason
from firmware_protocol.readers import Reader

Decoded: TypeAlias = tuple[bytes, Message | Malformed]


LINE_END = b"\n"
"""Stands between the lines of a shape; no line has it inside."""

CLASSES: dict[str, type[Any]] = {
    message_class.__name__: message_class for message_class in (*Message.__args__, Malformed)
}


class DecoderState(NamedTuple):
    """The line in progress, and how many there were of each class of messages and of malformed lines."""

    partial: bytes
    skipping: bool
    may_be_cut: bool
    counts: dict[str, int]
    malformed: dict[Reason, int]


MOST_SHAPES = 256
"""A board sends few shapes of reads, unless they are cut anywhere; beyond this many, lines are looked up one by one."""


class ReadShape:
    """How the lines of reads of one shape are read: the reader of each line, one such read, and how many came."""

    __slots__ = ("count", "example", "readers")

    def __init__(self, readers: tuple[Reader, ...], example: list[bytes]) -> None:
        self.readers, self.example, self.count = readers, example, 0


class Decoder:
    """Cuts one direction's bytes into lines and decodes them; how the bytes are chunked makes no difference.

    A line longer than ``max_line`` bytes (default: the framing's) is reported once, with its first
    ``max_line`` bytes, and skipped up to its end. No more than a line is ever kept.
    """

    def __init__(self, codec: LineCodec, max_line: int | None = None) -> None:
        self._codec = codec
        self._max_line = codec.framing.max_line if max_line is None else max_line
        if self._max_line < 1:
            raise ValueError(f"max_line must be at least 1 byte, got {max_line}")
        self._partial = b""
        self._skipping = False
        self._may_be_cut = False
        self._shapes: dict[bytes, ReadShape] = {}
        self._classes: defaultdict[type[Any], int] = defaultdict(int)
        self.malformed: Counter[Reason] = Counter()

    @property
    def accepted(self) -> dict[str, int]:
        """Lines decoded since the beginning, by the name of their message's class."""
        self._count_shapes()
        return {
            message_class.__name__: count
            for message_class, count in self._classes.items()
            if message_class is not Malformed
        }

    def state(self) -> DecoderState:
        """What it remembers."""
        self._count_shapes()
        counts = {message_class.__name__: count for message_class, count in self._classes.items()}
        return DecoderState(self._partial, self._skipping, self._may_be_cut, counts, dict(self.malformed))

    def restore(self, state: DecoderState) -> None:
        """Go on from there; raises ``KeyError`` for a class of messages that there is not."""
        self._partial, self._skipping, self._may_be_cut = state.partial, state.skipping, state.may_be_cut
        self._classes.clear()
        self._classes.update({CLASSES[name]: count for name, count in state.counts.items()})
        self.malformed = Counter(state.malformed)

    def feed(self, data: bytes) -> list[Decoded]:
        """Each line (without its end) that ``data`` completes, and what it means; empty ones are left out."""
        lines, messages = self.read(data)
        return list(zip(lines, messages, strict=True))

    def read(self, data: bytes) -> tuple[list[bytes], list[Any]]:
        """The lines (without their ends) that ``data`` completes, and what each means; empty ones are left out.

        Lines of plain numbers that come together again and again are read by one look-up.
        """
        lines, codec = self._cut(data), self._codec
        if not lines:
            return lines, lines
        if codec.is_plain and not self._may_be_cut:
            skeleton = LINE_END.join(lines).translate(None, NUMERIC)
            shape = self._shapes.get(skeleton)
            if shape is None:
                return self._learn_shape(skeleton, lines)
            if max(map(len, lines)) <= self._max_line:
                try:
                    messages = list(map(call, shape.readers, lines))
                except ValueError:
                    return self._decode(lines)
                shape.count += 1
                return lines, messages
        return self._decode(lines)

    def _learn_shape(self, skeleton: bytes, lines: list[bytes]) -> tuple[list[bytes], list[Any]]:
        """Decode lines of a shape that has not come before, and remember it if each of them is a line of numbers."""
        readers = [self._codec.reader_for(line) for line in lines]
        decoded = self._decode(lines)
        is_good = None not in readers and not any(type(message) is Malformed for message in decoded[1])
        if is_good and len(self._shapes) < MOST_SHAPES:
            self._shapes[skeleton] = ReadShape(tuple(filter(None, readers)), lines)
        return decoded

    def _count_shapes(self) -> None:
        """Count the lines of the reads that were decoded by their shape."""
        for shape in self._shapes.values():
            if shape.count:
                for reader, line in zip(shape.readers, shape.example, strict=True):
                    self._classes[type(reader(line))] += shape.count
                shape.count = 0

    def _cut(self, data: bytes) -> list[bytes]:
        """The lines that ``data`` completes."""
        if self._skipping:
            data = self._after_line_end(data)
        framing = self._codec.framing
        lines = (self._partial + data).replace(*framing.replaced).split(framing.end)
        self._partial = lines.pop()
        # The byte beyond the limit may be a CR that belongs to the line's end.
        if len(self._partial) > self._max_line + 1:
            lines.append(self._partial)
            self._partial, self._skipping = b"", True
        return lines

    def reset(self) -> None:
        """Forget the line in progress: what comes next belongs to another connection.

        That one usually begins in the middle of a line. So its first line is left out, and counted nowhere, if it means
        nothing; a whole one is taken, since a board that has just started begins with its banner.
        """
        self._partial, self._skipping, self._may_be_cut = b"", False, True

    def _after_line_end(self, data: bytes) -> bytes:
        _, end, rest = data.partition(self._codec.framing.end)
        self._skipping = not end
        return rest

    def _decode(self, lines: list[bytes]) -> tuple[list[bytes], list[Any]]:
        codec, limit, classes = self._codec, self._max_line, self._classes
        kept: list[bytes] = []
        messages: list[Any] = []
        for line in lines:  # a line may change the codec's mode
            if not line:
                continue
            meaning = codec.decode(line) if len(line) <= limit else self._overlong(line)
            meant = type(meaning)
            if self._may_be_cut:
                self._may_be_cut = False
                if meant is Malformed:
                    continue
            classes[meant] += 1
            if type(meaning) is Malformed:  # isinstance would cost every good line three times as much
                self.malformed[meaning.reason] += 1
                line = meaning.line
            kept.append(line)
            messages.append(meaning)
        if codec.regained:
            for regained in codec.regained:
                self._regain(regained, kept, messages)
            codec.regained = ()
        return kept, messages

    def _regain(self, regained: Regained, kept: list[bytes], messages: list[Any]) -> None:
        """What was refused counts after all; it comes before the line that showed so."""
        at = next(index for index, meaning in enumerate(messages) if meaning is regained.by)
        kept[at:at] = [line for line, _ in regained.lines]
        messages[at:at] = [message for _, message in regained.lines]
        for _, message in regained.lines:
            self._classes[type(message)] += 1

    def _overlong(self, line: bytes) -> Malformed:
        return Malformed(Reason.OVERLONG, line[: self._max_line], f"longer than {self._max_line} bytes")
