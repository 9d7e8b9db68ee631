"""The live server of Foxglove's own library, which has its own threads."""

import threading
from typing import Any

import foxglove
from foxglove.websocket import ServerListener

from chefbotd.components.foxglove.parameters import FoxgloveParameters
from chefbotd.components.recording.chunk import McapChannel


class _Subscriptions(ServerListener):
    """Counts subscriptions; the library calls it in its own threads."""

    def __init__(self) -> None:
        self._lock, self._held = threading.Lock(), set[tuple[int, int]]()

    @property
    def count(self) -> int:
        """The number of subscriptions."""
        return len(self._held)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """A client has subscribed to a channel."""
        with self._lock:
            self._held.add((client.id, channel.id))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """A client has unsubscribed or is gone."""
        with self._lock:
            self._held.discard((client.id, channel.id))


class FoxgloveServer:
    """Listens as soon as it is made; raises ``OSError`` if it cannot."""

    def __init__(self, parameters: FoxgloveParameters, name: str) -> None:
        self._context, self._subscriptions = foxglove.Context(), _Subscriptions()
        try:
            self._server = foxglove.start_server(
                name=name,
                host=parameters.host,
                port=parameters.port,
                server_listener=self._subscriptions,
                context=self._context,
            )
        except RuntimeError as error:
            raise OSError(
                f"Foxglove cannot be served on {parameters.host}:{parameters.port}: {error}"
            ) from error
        self.port: int = self._server.port
        self._channels: dict[int, Any] = {}

    @property
    def is_watched(self) -> bool:
        """Whether anybody is subscribed to anything."""
        return self._subscriptions.count > 0

    def send(self, channel: McapChannel, log_ns: int, payload: bytes) -> None:
        """Send a message, and offer its channel if it is new. The library drops messages for a slow client."""
        known_channel = self._channels.get(channel.number)
        if known_channel is None:
            schema = foxglove.Schema(
                name=channel.schema.name, encoding="jsonschema", data=channel.schema.text
            )
            known_channel = self._channels[channel.number] = foxglove.Channel(
                channel.topic, schema=schema, message_encoding="json", context=self._context
            )
        known_channel.log(payload, log_time=log_ns)

    def stop(self) -> None:
        """Stop serving."""
        self._server.stop()
