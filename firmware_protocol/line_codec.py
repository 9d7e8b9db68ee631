"""One direction of a wire: lines to messages and back, by a table of rows."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from firmware_protocol.lines import NUMERIC, LineKind
from firmware_protocol.messages import Banner, Malformed, Message, Reason, ResetDone, Text
from firmware_protocol.readers import Reader, reader_of

RESET_DONE = "Reset Done"

_UNPRINTABLE = re.compile(rb"[^\t\x20-\x7e]")
_CUT_NUMBERS = re.compile(rb"[-.\t]*[0-9][-.\t0-9]*")


class Regained(NamedTuple):
    """Lines that were refused, and what they mean after all, now that the line with the message ``by`` has come."""

    by: Message
    lines: tuple[tuple[bytes, Message | Malformed], ...]


@dataclass(frozen=True, slots=True)
class Framing:
    """How lines stand in one direction's bytes.

    ``replaced`` (what, by what) is done to the bytes before they are cut at ``end``; no line is longer than
    ``max_line`` bytes without its end.
    """

    separator: bytes
    end: bytes
    replaced: tuple[bytes, bytes]
    max_line: int


class LineCodec:
    """One direction of the wire.

    Args:
        framing: how its lines are separated and cut.
        rows: its line kinds; kinds may share their first field when their numbers differ in count.
        phrases: lines of text that mean something, exactly as they stand.
        text_end: the end of a line of text; None where text has no place.

    ``is_plain`` says whether a line of plain numbers means the same whatever came before it.

    Raises:
        ValueError: a row cannot be told from another, or its kind from a number.
    """

    regained: tuple[Regained, ...] = ()
    """What its last lines have brought back: who decodes takes it, and leaves nothing."""

    def __init__(
        self,
        framing: Framing,
        rows: Iterable[LineKind],
        phrases: Mapping[str, Message] | None = None,
        text_end: bytes | None = None,
    ) -> None:
        self.framing = framing
        self._text_end = text_end
        self._phrases = {text.encode(): message for text, message in (phrases or {}).items()}
        self._rows: dict[bytes, dict[int, LineKind]] = {}
        self._readers: dict[bytes, Reader] = {}
        self._packed: dict[tuple[bytes, int], Reader] = {}
        self._writers: dict[type[Any], list[LineKind]] = {}
        for row in rows:
            self._add(row)
        self.is_plain = not self._packed

    def _add(self, row: LineKind) -> None:
        kind, separator, count = row.kind.encode(), self.framing.separator, len(row.numbers)
        if not re.fullmatch(r"[A-Za-z_]+", row.kind):
            raise ValueError(f"a line kind is made of letters, got {row.kind!r}")
        if count in self._rows.get(kind, {}):
            raise ValueError(f"two line kinds {row.kind!r} with {count} numbers")
        if any(other.kind != row.kind for other in self._writers.get(row.message, ())):
            raise ValueError(f"two line kinds for {row.message.__name__}")
        self._rows.setdefault(kind, {})[count] = row
        self._readers[kind + separator * count] = reader_of(row, separator)
        if row.is_packed:
            self._packed[kind, count] = reader_of(row, separator)
        self._writers.setdefault(row.message, []).append(row)

    def reader_for(self, line: bytes) -> Reader | None:
        """What reads well-formed lines of numbers of this line's shape; None for any other line."""
        return self._readers.get(line.translate(None, NUMERIC))

    def decode(self, line: bytes) -> Message | Malformed:
        """What a line (without its end) means."""
        try:
            # Without its digits a well-formed line of numbers is its kind and its separators: one look-up
            # finds the reader and proves that nothing else stood there.
            message: Message = self._readers[line.translate(None, NUMERIC)](line)
            return message
        except (KeyError, ValueError):
            return self._decode_other(line)

    def _decode_other(self, line: bytes) -> Message | Malformed:
        if line in self._phrases:
            return self._phrases[line]
        if unprintable := _UNPRINTABLE.search(line):
            what = f"byte 0x{line[unprintable.start()]:02x} at {unprintable.start()}"
            return Malformed(Reason.NOT_ASCII, line, what)
        kind, *texts = line.split(self.framing.separator)
        if kind in self._rows:
            meant = self._decode_packed(kind, texts, line) or self._decode_leniently(kind, texts)
            return meant or _explain(self._rows[kind], line, texts)
        if _CUT_NUMBERS.fullmatch(line):
            return Malformed(Reason.UNKNOWN, line, "numbers without a kind")
        if self._text_end is None:
            return Malformed(Reason.UNKNOWN, line, f"expected one of {b' '.join(self._rows).decode()}")
        return Text(line.decode())

    def _decode_packed(self, kind: bytes, texts: list[bytes], line: bytes) -> Message | None:
        """What a line with packed levels means, which are no digits; None when it is refused, or no such line."""
        reader = self._packed.get((kind, len(texts)))
        if reader is None:
            return None
        try:
            message: Message = reader(line)
        except ValueError:
            return None
        return message

    def _decode_leniently(self, kind: bytes, texts: list[bytes]) -> Message | None:
        """What a line means whose numbers are written in another way; None when it is refused."""
        row = self._rows[kind].get(len(texts))
        rewritten = row.rewrite(texts) if row is not None and row.is_lenient else None
        if rewritten is None:
            return None
        separator = self.framing.separator
        try:
            message: Message = self._readers[kind + separator * len(texts)](
                separator.join((kind, *rewritten))
            )
        except ValueError:
            return None
        return message

    def encode(self, message: Message) -> bytes:
        """The message's line with its end.

        Raises:
            ValueError: a value does not fit its field; named with its range.
            TypeError: this direction has no such message.
        """
        rows = self._writers.get(type(message))
        if rows is None:
            line, end = self._text_line(message)
        else:
            row = rows[0] if len(rows) == 1 else _suiting(rows, message)
            line = self.framing.separator.join(text.encode() for text in row.write(message))
            end = row.end or self.framing.end
        if len(line) > self.framing.max_line:
            raise ValueError(f"a line holds {self.framing.max_line} bytes, got {len(line)}: {message!r}")
        return line + end

    def _text_line(self, message: Message) -> tuple[bytes, bytes]:
        if self._text_end is None or not isinstance(message, Banner | ResetDone | Text):
            raise TypeError(f"no line kind for {type(message).__name__} in this direction")
        line = (RESET_DONE if isinstance(message, ResetDone) else message.text).encode()
        if not line or self.decode(line) != message:
            raise ValueError(f"{line!r} would not be read as {message!r}")
        return line, self._text_end


def _suiting(rows: Iterable[LineKind], message: Message) -> LineKind:
    """The row for as many numbers as the message has; raises ``ValueError`` when there is none."""
    for row in rows:
        if row.suits(message):
            return row
    raise ValueError(f"no line holds as many numbers as {message!r}")


def _explain(rows: Mapping[int, LineKind], line: bytes, texts: list[bytes]) -> Malformed:
    """Why a line of a known kind was refused."""
    row = rows.get(len(texts))
    if row is None:
        expected = " or ".join(map(str, rows))
        return Malformed(Reason.FIELD_COUNT, line, f"expected {expected} numbers, got {len(texts)}")
    reason, detail = row.explain(texts)
    return Malformed(reason, line, detail)
