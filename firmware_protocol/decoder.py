"""Decodes received bytes into lines and messages, without I/O and with a bounded buffer."""

from collections import Counter, defaultdict
from typing import Any, NamedTuple, TypeAlias

from firmware_protocol.line_codec import LineCodec, Regained
from firmware_protocol.messages import Malformed, Message, Reason

Decoded: TypeAlias = tuple[bytes, Message | Malformed]


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
        self._classes: defaultdict[type[Any], int] = defaultdict(int)
        self.malformed: Counter[Reason] = Counter()

    @property
    def accepted(self) -> dict[str, int]:
        """Lines decoded since the beginning, by the name of their message's class."""
        return {
            message_class.__name__: count
            for message_class, count in self._classes.items()
            if message_class is not Malformed
        }

    def state(self) -> DecoderState:
        """What it remembers."""
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
        if self._skipping:
            data = self._after_line_end(data)
        framing = self._codec.framing
        lines = (self._partial + data).replace(*framing.replaced).split(framing.end)
        self._partial = lines.pop()
        # The byte beyond the limit may be a CR that belongs to the line's end.
        if len(self._partial) > self._max_line + 1:
            lines.append(self._partial)
            self._partial, self._skipping = b"", True
        return self._decode(lines)

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

    def _decode(self, lines: list[bytes]) -> list[Decoded]:
        codec, limit, classes = (
            self._codec,
            self._max_line,
            self._classes,
        )  # a line may change the codec's mode
        decoded: list[Decoded] = []
        for line in lines:
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
            decoded.append((line, meaning))
        if codec.regained:
            for regained in codec.regained:
                self._regain(regained, decoded)
            codec.regained = ()
        return decoded

    def _regain(self, regained: Regained, decoded: list[Decoded]) -> None:
        """What was refused counts after all; it comes before the line that showed so."""
        at = next(index for index, (_, meaning) in enumerate(decoded) if meaning is regained.by)
        decoded[at:at] = regained.lines
        for _, message in regained.lines:
            self._classes[type(message)] += 1

    def _overlong(self, line: bytes) -> Malformed:
        return Malformed(Reason.OVERLONG, line[: self._max_line], f"longer than {self._max_line} bytes")
