"""The channels of a recording: each has a topic and a schema, and the same number in every file of this daemon.

They are made where events are encoded, and written in the thread that writes.
"""

import threading
from collections.abc import Mapping
from typing import Any

import msgspec
from msgspec import Struct


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
