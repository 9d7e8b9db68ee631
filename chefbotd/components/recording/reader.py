"""Reads recordings. A file that was cut by a kill or a power cut is read up to its last whole chunk."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
)
from mcap.records import Message as McapMessage
from mcap.stream_reader import CRCValidationError, StreamReader
from msgspec import Struct

from chefbotd.components.recording.chunk import MAGIC
from chefbotd.components.recording.encoder import REPEATED
from chefbotd.components.recording.status import UnreadableRecording
from chefbotd.event_classes import class_of, decode
from chefbotd.storage import explain, open_regular

RECORD_HEAD, MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Source: https://mcap.dev/spec."""

NO_RECORD = 0
"""An opcode that no record has; zeros in a file are such records, each without content."""

MAX_CHUNK_BYTES = 256_000_000
"""Ours have a second in them; other programs' mostly 1 to 4 MB."""

CUT = "its end is missing: it is still being recorded, its writer was killed, its disk was full, or the file was cut"
OWN = "chefbotd."
"""How the names of the schemas of our own events begin."""


class RecordedMessage(Struct, frozen=True):
    """A message: its topic, its schema's name, when it was recorded (since 1970), its number and its JSON."""

    topic: str
    schema: str
    log_ns: int
    sequence: int
    data: bytes


DAMAGE = (
    McapError,
    CRCValidationError,
    struct.error,
    zlib.error,
    ValueError,
    RuntimeError,
    LookupError,
    OverflowError,
    MemoryError,
)
"""What the libraries raise for bytes that nobody wrote so; RecursionError is a RuntimeError."""


class _Records(StreamReader):
    """The records of a file; zeros are damage, which the library passes over as records that it does not know."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode == NO_RECORD:
            raise ValueError("there are zeros in place of a record")
        return super()._read_record(opcode, length)


class _Counts:
    """Holds the messages that were found against what the file says of them: a record that is lost is missed here.

    A record whose kind or length is damaged is passed over, and the messages of a chunk with it; but the index that
    follows each chunk, and the statistics at the end, count them.
    """

    def __init__(self) -> None:
        self.messages = 0
        self._of_chunk = self._indexed = 0
        self.problem: str | None = None

    def add(self, count: int) -> None:
        self.messages += count
        self._of_chunk += count

    def take(self, record: McapRecord) -> None:
        match record:
            case MessageIndex():
                self._indexed += len(record.records)
            case Chunk() | DataEnd():
                self._end_chunk()
            case Statistics() if record.message_count != self.messages:
                self._miss(f"of {record.message_count} messages it holds {self.messages}")

    def _end_chunk(self) -> None:
        """Compare the last chunk with its index; a file without indexes says nothing."""
        if self._indexed and self._indexed != self._of_chunk:
            self._miss(f"of {self._indexed} messages that an index names, {self._of_chunk} are there")
        self._of_chunk = self._indexed = 0

    def _miss(self, problem: str) -> None:
        self.problem = self.problem or f"it is damaged: {problem}"


class RecordingReader:
    """A recording. What stands in it is known once ``messages`` or ``events`` has come to its end.

    ``problem`` says what is wrong with the end of the file; it is None where the file is complete.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = _check(path)
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.problem: str | None = None
        self._topics: dict[int, tuple[str, str]] = {}
        self._schemas: dict[int, str] = {}

    def messages(self, schemas: str = "") -> Iterator[RecordedMessage]:
        """Every message, in the order in which they were recorded; or those alone whose schemas' names begin so.

        Raises:
            UnreadableRecording: nothing at all can be read.
        """
        with open_regular(self.path) as file:
            yield from self._messages(file, schemas)

    def events(self) -> Iterator[Any]:
        """Every event of the daemon as it was published, in its order; those of unknown classes are left out.

        Raises:
            UnreadableRecording: nothing can be read, or an event is none.
        """
        unknown: set[str] = set()
        for message in self.messages(OWN):
            if message.sequence == REPEATED:
                continue
            event_class = class_of(message.schema.removeprefix(OWN))
            if event_class is None:
                unknown.add(message.schema)
                continue
            try:
                yield decode(event_class, message.data)
            except (ValueError, RecursionError) as error:
                raise UnreadableRecording(
                    f"{self.path}: event {message.sequence} on {message.topic} is none: {error}"
                ) from error
        if unknown and self.problem is None:
            names = ", ".join(sorted(unknown))
            self.problem = f"events of kinds that this version does not know are left out: {names}"

    def read_about(self) -> None:
        """Read the ``metadata`` and the ``attachments`` at the beginning of the file."""
        for _ in self.messages():
            return

    def _messages(self, file: BinaryIO, schemas: str) -> Iterator[RecordedMessage]:
        reader = _Records(file, emit_chunks=True, validate_crcs=True, record_size_limit=self.size)
        ended, counts = False, _Counts()
        try:
            for record in reader.records:
                ended = isinstance(record, Footer)
                counts.take(record)
                if isinstance(record, Chunk):
                    yield from self._messages_in(_unpack_chunk(record), schemas, counts)
                elif isinstance(record, McapMessage):
                    counts.messages += 1
                    topic, schema = self._channel(record.channel_id)
                    if schema.startswith(schemas):
                        yield RecordedMessage(topic, schema, record.log_time, record.sequence, record.data)
                else:
                    self._note(record)
        except EndOfFile:
            self.problem = CUT
        except DAMAGE as error:
            cut = isinstance(error, struct.error) and not file.read(1)  # within the head of a record
            self.problem = CUT if cut else f"it is damaged or was cut: {str(error) or type(error).__name__}"
        except Exception as error:
            if type(error).__module__.partition(".")[0] not in ("zstandard", "zstd", "lz4"):
                raise
            self.problem = f"it is damaged or was cut: {error}"
        if self.problem is None and not ended:
            self.problem = "it was not finished: its writer was stopped"
        self.problem = self.problem if counts.problem is None else counts.problem

    def _messages_in(self, data: bytes, schemas: str, counts: _Counts) -> Iterator[RecordedMessage]:
        """The messages of a chunk. There are a thousand a second, and the library takes 10 us for each of them.

        Raises:
            ValueError: the chunk is damaged.
        """
        at, size, head, topics, messages_seen = 0, len(data), MESSAGE_HEAD.size, self._topics, 0
        while at < size:
            opcode, length = RECORD_HEAD.unpack_from(data, at)
            at, end = at + RECORD_HEAD.size, at + RECORD_HEAD.size + length
            if end > size:
                raise ValueError("a record is longer than its chunk")
            if opcode == Opcode.MESSAGE:
                messages_seen += 1
                channel, sequence, log_ns, _ = MESSAGE_HEAD.unpack_from(data, at)
                topic, schema = topics.get(channel) or self._channel(channel)
                if schema.startswith(schemas):
                    yield RecordedMessage(topic, schema, log_ns, sequence, data[at + head : end])
            elif opcode == Opcode.CHANNEL:
                self._note(Channel.read(ReadDataStream(BytesIO(data[at:end]))))
            elif opcode == Opcode.SCHEMA:
                self._note(Schema.read(ReadDataStream(BytesIO(data[at:end]))))
            at = end
        counts.add(messages_seen)

    def _channel(self, number: int) -> tuple[str, str]:
        if number not in self._topics:
            raise ValueError(f"a message is of channel {number}, which is not in it")
        return self._topics[number]

    def _note(self, record: McapRecord) -> None:
        """Keep what stands beside the messages; schemas and channels are repeated at the end of a file.

        Raises:
            ValueError: it is repeated otherwise.
        """
        if isinstance(record, Schema):
            if self._schemas.setdefault(record.id, record.name) != record.name:
                raise ValueError(f"schema {record.id} is {self._schemas[record.id]!r} and {record.name!r}")
        elif isinstance(record, Channel):
            topic = record.topic, self._schemas.get(record.schema_id, "")
            if self._topics.setdefault(record.id, topic) != topic:
                raise ValueError(f"channel {record.id} is {self._topics[record.id]} and {topic}")
        elif isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            self.attachments[record.name] = record.data


def _unpack_chunk(chunk: Chunk) -> bytes:
    """The records of a chunk, which may not be more than it says, nor more than anybody writes.

    Raises:
        ValueError: they are, or they are not those that were written.
    """
    size, data = chunk.uncompressed_size, chunk.data
    if chunk.compression == "zstd":
        import zstandard

        size = max(size, zstandard.frame_content_size(data))
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes, expected at most {MAX_CHUNK_BYTES}")
    if chunk.compression == "zstd":
        data = zstandard.decompress(data, size)
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
    elif chunk.compression:
        raise ValueError(f"a chunk is compressed by {chunk.compression!r}, expected zstd or lz4")
    if len(data) != chunk.uncompressed_size or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk is not what was written: its size or its checksum is another one")
    return data


def _check(path: Path) -> int:
    """The size of what may be a recording."""
    try:
        if path.is_dir():
            raise UnreadableRecording(f"{path} is a folder, expected a recording (.mcap)")
        with open_regular(path) as file:
            start = file.read(len(MAGIC))
        size = path.stat().st_size
    except OSError as error:
        raise UnreadableRecording(f"{path} cannot be read: {explain(error)}") from error
    if not size:
        raise UnreadableRecording(f"{path} is empty, expected a recording (.mcap)")
    if start != MAGIC:
        short = start != MAGIC[: len(start)]
        what = "is not an MCAP file" if short else f"ends after {size} bytes: nothing was recorded"
        raise UnreadableRecording(f"{path} {what}, expected a recording (.mcap)")
    return size
