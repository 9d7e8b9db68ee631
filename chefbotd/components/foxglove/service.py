"""Publishes events to Foxglove on the channels of a recording."""

import asyncio
import time
from collections.abc import Callable
from typing import Any, Protocol

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.foxglove.parameters import FoxgloveParameters
from chefbotd.components.recording.chunk import Channels, McapChannel
from chefbotd.components.recording.encoder import REPEATED, Encoder, MapEvent
from chefbotd.components.recording.foxglove import MapDrawer, ReadMap
from chefbotd.components.recording.recorder_thread import read_map
from chefbotd.features.feature import Feature, Service
from chefbotd.inputs import inputs_of
from chefbotd.logs import RateLimitedLog

log = structlog.get_logger(component="foxglove")

INBOX_EVENTS = 4096
AGAIN_S = 5.0
"""The channels whose last message still holds, such as the map."""

EXCLUDED = frozenset({"LineSeen", "StateRecorded"})


SUBPROTOCOL = "foxglove.sdk.v1"
"""The only one that the library serves; it refuses older clients (``foxglove.websocket.v1``) with HTTP 400."""


class Server(Protocol):
    """The server to which Foxglove connects."""

    port: int

    @property
    def is_watched(self) -> bool:
        """Whether anybody is subscribed to anything."""
        ...

    def send(self, channel: McapChannel, log_ns: int, payload: bytes) -> None:
        """Send a message, and offer its channel if it is new; never waits."""
        ...

    def stop(self) -> None:
        """Stop serving."""
        ...


class _Live:
    """A sink of messages that sends them."""

    def __init__(self, server: Server, channels: Channels) -> None:
        self._server, self._channels = server, channels

    def add(self, channel: int, sequence: int, log_ns: int, payload: bytes) -> None:
        """Send one."""
        self._server.send(self._channels.between(channel - 1, channel)[0], log_ns, payload)


class FoxgloveService:
    """Serves Foxglove. Without a subscriber, an event costs one look-up of its class."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        start: Callable[[], Server],
        first_scanner: str | None,
        read_map: ReadMap,
    ) -> None:
        self._bus, self._clock, self._start = bus, clock, start
        self._first_scanner, self._read_map = first_scanner, read_map
        self._problems = RateLimitedLog(log)
        self.port: int | None = None

    async def run(self) -> None:
        """Serve until cancelled."""
        inbox = self._bus.subscribe_all(INBOX_EVENTS, EXCLUDED)
        end_inputs = inputs_of(self._clock).begin_recording()
        try:
            server = self._start()
        except OSError as error:
            log.error("Foxglove is not served", error=str(error))
            end_inputs()
            inbox.close()
            await asyncio.Event().wait()  # the robot drives on without
            return
        self.port = server.port
        log.info("Foxglove can connect", port=server.port, subprotocol=SUBPROTOCOL)
        try:
            await self._serve(server, inbox)
        finally:
            server.stop()
            end_inputs()
            inbox.close()

    async def _serve(self, server: Server, inbox: Any) -> None:
        channels = Channels()
        live = _Live(server, channels)
        offset_ns = time.time_ns() - round(self._clock.now_s() * 1e9)
        encoder = Encoder(live, channels, offset_ns, self._first_scanner)
        maps = MapDrawer(channels, self._read_map)
        offered = set[type[Any]]()
        while True:
            await inbox.next_put()
            watched = server.is_watched
            for event in inbox.take_all():
                if watched or type(event) not in offered or getattr(event, "retained", False):
                    offered.add(type(event))
                    self._send_event(encoder, event)
            drawn, now_ns = encoder.take_maps(), self._now_ns(offset_ns)
            is_due = watched and now_ns - maps.drawn_ns > AGAIN_S * 1e9
            if is_due:  # for whoever has come since
                for channel, payload in encoder.holds():
                    live.add(channel, REPEATED, now_ns, payload)
            if drawn or is_due:
                await asyncio.to_thread(_draw, maps, drawn, now_ns, live)

    def _send_event(self, encoder: Encoder, event: Any) -> None:
        try:
            encoder.encode_event(event)
        except Exception as error:  # noqa: BLE001 - told; the robot is not to suffer
            self._problems.warning(
                "an event cannot be shown", event_class=type(event).__name__, error=repr(error)
            )

    def _now_ns(self, offset_ns: int) -> int:
        return offset_ns + int(self._clock.now_s() * 1e9)


def _draw(maps: MapDrawer, events: tuple[MapEvent, ...], now_ns: int, sink: Any) -> None:
    """Encode in a thread, because a large map takes a while."""
    for event, log_ns, sequence in events:
        maps.draw(event, log_ns, sequence, sink)
    if not events:
        maps.tell(now_ns, REPEATED, sink)
        maps.drawn_ns = now_ns


def foxglove(
    bus: Bus, clock: Clock, parameters: FoxgloveParameters, robot: str, first_scanner: str | None
) -> Feature:
    """The feature that serves Foxglove."""
    from chefbotd.components.foxglove.server import FoxgloveServer  # an optional library

    service = FoxgloveService(bus, clock, lambda: FoxgloveServer(parameters, robot), first_scanner, read_map)
    return Feature("foxglove", services=(Service("foxglove", service.run),))
