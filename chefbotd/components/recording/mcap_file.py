"""Writes one MCAP file: header, description of the robot, chunks, and the summary with which readers seek.

Up to its last whole chunk it can be read at any moment, also after a kill: only the summary is missing then.
"""

import zlib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from chefbotd.components.recording.chunk import MAGIC, Channels, Chunk
from chefbotd.components.recording.folder import OpenFile, RecordingDisk

PROFILE = ""
JSON, JSON_SCHEMA = "json", "jsonschema"
LIBRARY = "chefbotd"


class RecordingFile:
    """A file that chunks are appended to. Its methods raise ``OSError``; after that, ``abandon`` it."""

    def __init__(self, disk: RecordingDisk, path: Path, channels: Channels) -> None:
        self.path, self._channels = path, channels
        self._file: OpenFile = disk.create(path)
        self.size = self.messages = 0
        self._checksum = 0
        self._known_channels = 0
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()

    def begin(self) -> None:
        """Write what stands before everything else."""
        self._write_data(MAGIC + _bytes_of(Header(PROFILE, LIBRARY)))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add facts by name."""
        data = _bytes_of(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=self.size, length=len(data), name=name))
        self._write_data(data)

    def add_attachment(self, name: str, media_type: str, data: bytes, stamp_ns: int) -> None:
        """Add a file within the file."""
        record = _bytes_of(
            Attachment(create_time=stamp_ns, log_time=stamp_ns, name=name, media_type=media_type, data=data)
        )
        self._attachments.append(
            AttachmentIndex(
                offset=self.size,
                length=len(record),
                create_time=stamp_ns,
                log_time=stamp_ns,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )
        self._write_data(record)

    def add_chunk(self, chunk: Chunk) -> None:
        """Append a chunk, and before it the channels that are new in it."""
        before, self._known_channels = self._known_channels, len(self._channels)
        news = b"".join(_bytes_of(record) for group in self._described(before) for record in group)
        start = self.size + len(news)
        indexes = start + len(chunk.head) + len(chunk.data)
        self._write_data(news + chunk.head + chunk.data + chunk.indexes)
        self._counts.update(chunk.counts)
        self.messages += chunk.message_count
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.start_ns,
                message_end_time=chunk.end_ns,
                chunk_start_offset=start,
                chunk_length=indexes - start,
                message_index_offsets={
                    channel: indexes + offset for channel, offset in chunk.index_offsets.items()
                },
                message_index_length=len(chunk.indexes),
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=chunk.size,
            )
        )

    def sync(self) -> None:
        """Wait until all of it is on the disk."""
        self._file.sync()

    def finish(self) -> None:
        """Write the summary, wait until all is on the disk, and close."""
        self._write_data(_bytes_of(DataEnd(self._checksum)))
        summary, start = RecordBuilder(), self.size
        offsets: list[SummaryOffset] = []
        schemas, channels = self._described(0)
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, [*schemas]),
            (Opcode.CHANNEL, [*channels]),
            (Opcode.STATISTICS, [self._statistics(len(schemas))]),
            (Opcode.CHUNK_INDEX, [*self._chunks]),
            (Opcode.ATTACHMENT_INDEX, [*self._attachments]),
            (Opcode.METADATA_INDEX, [*self._metadata]),
        ]
        for opcode, records in groups:
            began = summary.count
            for record in records:
                record.write(summary)
            length = summary.count - began
            if length:
                offsets.append(
                    SummaryOffset(group_opcode=opcode, group_start=start + began, group_length=length)
                )
        offset_start = start + summary.count
        for offset in offsets:
            offset.write(summary)
        Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=0).write(summary)
        data: bytes = summary.end()  # type: ignore[no-untyped-call]
        self._write_data(data + MAGIC)
        self._file.sync()
        self._file.close()

    def abandon(self) -> None:
        """After an error: cut what was written of a chunk, so that the file ends with a whole one, and close."""
        try:
            self._file.truncate(self.size)
        finally:
            self._file.close()

    def _described(self, after: int) -> tuple[list[Schema], list[Channel]]:
        """The channels that this file knows, with numbers above ``after``, and their schemas."""
        rows = self._channels.between(after, self._known_channels)
        schemas = {
            row.schema.number: Schema(
                id=row.schema.number, name=row.schema.name, encoding=JSON_SCHEMA, data=row.schema.text
            )
            for row in rows
        }
        channels = [
            Channel(
                id=row.number,
                topic=row.topic,
                message_encoding=JSON,
                metadata={},
                schema_id=row.schema.number,
            )
            for row in rows
        ]
        return list(schemas.values()), channels

    def _write_data(self, data: bytes) -> None:
        self._file.write(data)
        self.size += len(data)
        self._checksum = zlib.crc32(data, self._checksum)

    def _statistics(self, schemas: int) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=self._known_channels,
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self.messages,
            metadata_count=len(self._metadata),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            schema_count=schemas,
        )


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
