"""The channels of a recording: each has a topic and a schema, and the same number in every file of this daemon."""

from collections.abc import Mapping
from typing import Any

import msgspec
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema

JSON, JSON_SCHEMA = "json", "jsonschema"


class Channels:
    """Every channel that there has been, in the order of their numbers, which begin at 1."""

    def __init__(self) -> None:
        self._by_topic: dict[str, int] = {}
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []

    def __len__(self) -> int:
        return len(self._channels)

    def number(self, topic: str, schema_name: str, schema: Mapping[str, Any]) -> int:
        """The number of the channel of this topic, made where there is none."""
        known = self._by_topic.get(topic)
        if known is not None:
            return known
        row = self._schemas.get(schema_name)
        if row is None:
            text = msgspec.json.encode(schema)
            row = Schema(id=len(self._schemas) + 1, name=schema_name, encoding=JSON_SCHEMA, data=text)
            self._schemas[schema_name] = row
        number = len(self._channels) + 1
        self._channels.append(
            Channel(id=number, topic=topic, message_encoding=JSON, metadata={}, schema_id=row.id)
        )
        self._by_topic[topic] = number
        return number

    def between(self, after: int, up_to: int) -> tuple[list[Schema], list[Channel]]:
        """The channels with numbers above ``after``, up to ``up_to``, and their schemas."""
        channels = self._channels[after:up_to]
        needed = {channel.schema_id for channel in channels}
        return [schema for schema in self._schemas.values() if schema.id in needed], channels

    def records(self, after: int = 0) -> bytes:
        """The records of the channels with numbers above ``after``, each after its schema."""
        builder = RecordBuilder()
        for group in self.between(after, len(self._channels)):
            for record in group:
                record.write(builder)
        data: bytes = builder.end()  # type: ignore[no-untyped-call]
        return data
