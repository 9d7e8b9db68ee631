"""A chunk of a recording in the MCAP format: compressed messages with an index.

Source of the layout: https://mcap.dev/spec (version 0). A message is packed here and not by the library, whose
``add_message`` takes 15 us where this takes 1.5: everything else is written with the library's records. A chunk is
complete in itself: the ring keeps it, and any number of files take it as it is.
"""

import struct
import sys
import threading
import zlib
from array import array
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec import Struct

# The channels of a recording: each has a topic and a schema, and the same number in every file of this daemon.
#
# They are made where events are encoded, and written in the thread that writes.


class Schema(Struct, frozen=True):
    """A schema with its number, and its text in JSON."""

    number: int
    name: str
    text: bytes


class McapChannel(Struct, frozen=True):
    """A channel with its number."""

    number: int
    topic: str
    schema: Schema


class Channels:
    """Every channel that there has been, in the order of their numbers, which begin at 1."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_topic: dict[str, int] = {}
        self._schemas: dict[str, Schema] = {}
        self._channels: list[McapChannel] = []

    def __len__(self) -> int:
        return len(self._channels)

    def number(self, topic: str, schema_name: str, schema: Mapping[str, Any]) -> int:
        """The number of the channel of this topic, made where there is none."""
        number = self._by_topic.get(topic)
        return number if number is not None else self._make(topic, schema_name, schema)

    def _make(self, topic: str, schema_name: str, schema: Mapping[str, Any]) -> int:
        with self._lock:
            row = self._schemas.get(schema_name)
            if row is None:
                row = Schema(len(self._schemas) + 1, schema_name, msgspec.json.encode(schema))
                self._schemas[schema_name] = row
            number = self._by_topic[topic] = len(self._channels) + 1
            self._channels.append(McapChannel(number, topic, row))
        return number

    def between(self, after: int, up_to: int) -> list[McapChannel]:
        """The channels with numbers above ``after``, up to ``up_to``."""
        return self._channels[after:up_to]


MAGIC = b"\x89MCAP0\r\n"
"""At the beginning and at the end of every file."""

MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
MESSAGE_HEAD_BYTES = MESSAGE.size - 9
CHUNK_HEAD = struct.Struct("<BQQQQI")
INDEX_HEAD = struct.Struct("<BQHI")
MESSAGE_OPCODE, CHUNK_OPCODE, INDEX_OPCODE = 0x05, 0x06, 0x07

Index: TypeAlias = "dict[int, array[int]]"
"""For each channel the time and the place of each of its messages, by turns, as in the file: 64 bits each."""

Compress = Callable[[bytes | bytearray], bytes]


CHUNK_BYTES, CHANNEL_BYTES = 800, 270
"""An empty chunk and each of its channels, by ``sys.getsizeof`` of CPython 3.11: objects, dictionaries and numbers."""


class Chunk(Struct, frozen=True):
    """Bytes that can be written into any file with the same channels: ``head``, ``data`` and ``indexes`` in this order.

    ``index_offsets`` is where each channel's index begins in ``indexes``, ``counts`` how many messages each has.
    """

    start_ns: int
    end_ns: int
    compression: str
    size: int
    head: bytes
    data: bytes
    indexes: bytes
    index_offsets: dict[int, int]
    counts: dict[int, int]

    @property
    def message_count(self) -> int:
        """How many messages are in it."""
        return sum(self.counts.values())

    @property
    def bytes_in_file(self) -> int:
        """What it takes on the disk."""
        return len(self.head) + len(self.data) + len(self.indexes)

    @property
    def bytes_held(self) -> int:
        """What it takes of this process's memory: each channel has two entries in dictionaries."""
        return self.bytes_in_file + CHUNK_BYTES + CHANNEL_BYTES * len(self.counts)


class ChunkBuilder:
    """Takes messages until ``cut``; ``size`` is how many bytes they are before compression."""

    def __init__(self) -> None:
        self._records = bytearray()
        self._index: Index = {}
        self._start_ns = self._end_ns = 0

    @property
    def size(self) -> int:
        """Bytes so far."""
        return len(self._records)

    def add(self, channel: int, sequence: int, log_ns: int, payload: bytes) -> None:
        """Add a message."""
        records = self._records
        entries = self._index.get(channel)
        if entries is None:
            if not self._index:
                self._start_ns = self._end_ns = log_ns
            entries = self._index[channel] = array("Q")
        entries.extend((log_ns, len(records)))
        if log_ns > self._end_ns:
            self._end_ns = log_ns
        elif log_ns < self._start_ns:
            self._start_ns = log_ns
        length = MESSAGE_HEAD_BYTES + len(payload)
        records += MESSAGE.pack(MESSAGE_OPCODE, length, channel, sequence, log_ns, log_ns)
        records += payload

    def cut(self) -> "RawChunk | None":
        """Return all messages so far and start empty; None where there are none."""
        if not self._index:
            return None
        raw = RawChunk(self._records, self._index, self._start_ns, self._end_ns)
        self._records, self._index = bytearray(), {}
        return raw


class RawChunk(Struct, frozen=True):
    """Messages that are not compressed yet: their records, and for each channel times and places of its messages."""

    records: bytearray
    index: Index
    start_ns: int
    end_ns: int

    @property
    def weight(self) -> int:
        """About how many bytes it takes in memory."""
        return len(self.records) + sum(entries.itemsize * len(entries) for entries in self.index.values())

    def pack(self, compression: Literal["zstd", "lz4"], compress: Compress) -> Chunk:
        """Compress it, and make its index."""
        records, name = self.records, compression.encode()
        data = compress(records)
        tail = struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data))
        length = CHUNK_HEAD.size - 9 + len(tail) + len(data)
        head = CHUNK_HEAD.pack(
            CHUNK_OPCODE, length, self.start_ns, self.end_ns, len(records), zlib.crc32(records)
        )
        offsets: dict[int, int] = {}
        indexes = bytearray()
        for channel, entries in self.index.items():
            offsets[channel] = len(indexes)
            if sys.byteorder == "big":
                entries = array("Q", entries)
                entries.byteswap()
            packed = entries.tobytes()
            indexes += INDEX_HEAD.pack(INDEX_OPCODE, 6 + len(packed), channel, len(packed)) + packed
        counts = {channel: len(entries) // 2 for channel, entries in self.index.items()}
        return Chunk(
            self.start_ns,
            self.end_ns,
            compression,
            len(records),
            head + tail,
            data,
            bytes(indexes),
            offsets,
            counts,
        )


def compressor(compression: Literal["zstd", "lz4"]) -> Compress:
    """What compresses; both let go of the interpreter meanwhile, so that control runs on."""
    if compression == "lz4":
        import lz4.frame

        pack: Compress = lz4.frame.compress
        return pack
    import zstandard

    fast: Compress = zstandard.ZstdCompressor(level=1).compress
    return fast


class Ring:
    """Chunks of the last ``seconds``, which hold ``most_bytes`` of memory at most; the oldest give way."""

    def __init__(self, seconds: float, most_bytes: int) -> None:
        self._span_ns, self._most_bytes = round(seconds * 1e9), most_bytes
        self._chunks: deque[Chunk] = deque()
        self.size = 0

    def add(self, chunk: Chunk) -> None:
        """Add the newest one."""
        self._chunks.append(chunk)
        self.size += chunk.bytes_held
        oldest_ns = chunk.end_ns - self._span_ns
        while self._chunks and (self.size > self._most_bytes or self._chunks[0].end_ns < oldest_ns):
            self.size -= self._chunks.popleft().bytes_held

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """From the oldest to the newest."""
        return tuple(self._chunks)

    @property
    def seconds(self) -> float:
        """How far back it reaches."""
        return (self._chunks[-1].end_ns - self._chunks[0].start_ns) / 1e9 if self._chunks else 0.0
