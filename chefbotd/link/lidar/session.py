"""A lidar as seen from its wire: bytes in, scans and health out; requests out where it wants any."""

import asyncio
from collections import Counter
from typing import cast

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import OdometryUpdated
from chefbotd.core.events.inputs import LinkBytesWritten
from chefbotd.core.events.lidars import LidarChanged, ScanMeasured
from chefbotd.core.record import Record
from chefbotd.inputs import Timer, due_of, inputs_of
from chefbotd.link.lidar.health import LidarCondition, LidarHealthWatch, LidarTotals
from chefbotd.link.lidar.ld19_reader import Ld19Reader, Ld19State
from chefbotd.link.lidar.rplidar_reader import RplidarReader, RplidarState
from chefbotd.link.lidar.turn import LidarTurn, RepeatFinder, Travel, scan_of
from chefbotd.link.port import LinkParameters, PortTransport
from chefbotd.sensing.lidar import LidarModel, LidarParameters
from firmware_protocol.lidar import ld19, rplidar

log = structlog.get_logger(component="lidar")

SAMPLE_BYTES = 128
DOWN, UNKNOWN = "down", "unknown"
POLL_EVERY_S = 0.05


def baud_of(lidar: LidarParameters) -> int:
    """The configured baud rate, or the model's own."""
    return lidar.baud or (ld19.BAUD if lidar.model.is_ldrobot else rplidar.BAUD)


def port_of(lidar: LidarParameters) -> LinkParameters:
    """How the lidar's port is opened. DTR is off: it stands for "stop the motor" on an RPLIDAR A1."""
    return LinkParameters(
        device=lidar.device, baud=baud_of(lidar), exclusive=lidar.exclusive, dtr=lidar.model.is_ldrobot
    )


def link_of(lidar: LidarParameters) -> str:
    """The name of the lidar's link in a recording."""
    return f"lidar/{lidar.name}"


def _reader_of(lidar: LidarParameters) -> Ld19Reader | RplidarReader:
    """One side of the wire, without I/O; it lives across reconnections and keeps its counters.

    ``complaint`` is what the lidar itself says is wrong, or what it is instead of the configured one (empty: nothing).
    """
    baud = baud_of(lidar)
    if lidar.model.is_ldrobot:
        return Ld19Reader(baud)
    return RplidarReader(lidar.model, baud, express=lidar.express)


class LidarSessionState(Record, frozen=True):
    """What the session remembers of its lidar, but for the port itself; ``due_s`` is when it is polled next."""

    reader: Ld19State | RplidarState
    repeats: RepeatFinder
    travel: Travel
    health: LidarHealthWatch
    sample: bytes
    due_s: float | None
    heard_s: float
    bytes_in: int
    opens: int
    scans: int
    scans_before: int
    repeated: int
    turn_s: float | None
    sharers: str = ""


class LidarSession(asyncio.Protocol):
    """An asyncio protocol that survives reconnections and keeps its counters. It publishes each scan when it ends."""

    def __init__(self, bus: Bus, clock: Clock, lidar: LidarParameters) -> None:
        self._bus, self._clock, self.lidar = bus, inputs_of(clock), lidar
        self.reader = _reader_of(lidar)
        self._base_from_lidar = lidar.base_from_lidar
        self._repeats, self._travel = RepeatFinder(), Travel()
        bus.add_handler(self._add_travel, OdometryUpdated)
        self._transport: asyncio.Transport | None = None
        self._closed = asyncio.Event()
        self._closed.set()
        self._sample, self._sharers = b"", ""
        self._poll_timer: Timer | None = None
        self._scans_before, self._heard_s = 0, 0.0
        self._health = LidarHealthWatch(0.0, LidarTotals())
        self.bytes_in = self.opens = self.scans = self.repeated = 0
        self.turn_s: float | None = None

    def state(self) -> LidarSessionState:
        """Return the state of this part."""
        return LidarSessionState(
            self.reader.state(),
            self._repeats,
            self._travel,
            self._health,
            self._sample,
            due_of(self._poll_timer),
            self._heard_s,
            self.bytes_in,
            self.opens,
            self.scans,
            self._scans_before,
            self.repeated,
            self.turn_s,
            self._sharers,
        )

    def restore(self, state: LidarSessionState) -> None:
        """Go on from there; the port is open already, where it was. Raises ``TypeError`` for another model's state."""
        match self.reader, state.reader:
            case (Ld19Reader() as ld19_reader, Ld19State() as of_ld19):
                ld19_reader.restore(of_ld19)
            case (RplidarReader() as rplidar_reader, RplidarState() as of_rplidar):
                rplidar_reader.restore(of_rplidar)
            case _:
                raise TypeError(f"the state is not that of {self.lidar.model}")
        self._repeats, self._travel, self._health = state.repeats, state.travel, state.health
        self._sample, self._heard_s = state.sample, state.heard_s
        self.bytes_in, self.opens, self.repeated = state.bytes_in, state.opens, state.repeated
        self.scans, self._scans_before, self.turn_s = state.scans, state.scans_before, state.turn_s
        self._sharers = state.sharers
        self._poll_timer = self._clock.resume(state.due_s, self._poll, self._poll_name)

    # What asyncio tells us

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A port was opened: nothing is known of it yet."""
        self._transport = cast(asyncio.Transport, transport)
        now_s = self._clock.now_s()
        self.opens += 1
        self._scans_before, self._sample = self.scans, b""
        self._health = LidarHealthWatch(now_s, self._heard())
        self._say(self.reader.begin(now_s))
        self._report_condition(UNKNOWN, "", healthy=None)
        self._poll()

    def connection_lost(self, exc: Exception | None) -> None:
        """The port is gone."""
        self._transport = None
        if self._poll_timer is not None:
            self._poll_timer.cancel()
        self._report_condition(DOWN, str(exc) if exc else "closed", healthy=False)
        self._closed.set()

    def data_received(self, data: bytes) -> None:
        """Stamp, read, publish what is whole, and ask for what comes next."""
        now_s = self._clock.now_s()
        self.bytes_in, self._heard_s = self.bytes_in + len(data), now_s
        self._sample = (self._sample + data[-SAMPLE_BYTES:])[-SAMPLE_BYTES:]
        for turn in self.reader.read_bytes(data, now_s):
            self._take_turn(turn)
        self._say(self.reader.poll(now_s))

    def _take_turn(self, turn: LidarTurn) -> None:
        """Publish a turn, unless it repeats an older one: then it is no measurement."""
        if self._repeats.is_repeated(turn, self._travel.travelled_m):
            self.repeated += 1
            return
        scan = scan_of(self.lidar, turn)
        self.scans += 1
        self.turn_s = float(turn.stamp_s[-1] - turn.stamp_s[0])
        self._bus.publish(ScanMeasured(scan.stamp_s, self.lidar.name, self._base_from_lidar, scan))

    def _add_travel(self, odometry: OdometryUpdated) -> None:
        self._travel.add_twist(odometry.stamp_s, odometry.twist)

    # What the link asks

    @property
    def is_open(self) -> bool:
        """Whether a port is connected."""
        return self._transport is not None

    @property
    def is_proven(self) -> bool:
        """Whether a whole turn has come in since the port was opened."""
        return self.scans > self._scans_before

    def judge_health(self) -> None:
        """Look at what has come in lately; a change is published and logged. Call it a few times a second."""
        health = self._health.look(self._clock.now_s(), self._heard(), self._sample, self.reader.complaint)
        if health is None or not self.is_open:
            return
        healthy = health.condition is LidarCondition.HEALTHY
        reason = "; ".join(text for text in (health.reason, self._sharers) if text and not healthy)
        self._report_condition(str(health.condition), reason, healthy=healthy)
        if not healthy:
            log.warning(
                "the link to the lidar is not healthy",
                lidar=self.lidar.name,
                condition=str(health.condition),
                reason=reason,
            )

    def report_not_opened(self, reason: str) -> None:
        """Publish why the port cannot be opened."""
        self._report_condition(DOWN, reason, healthy=False)

    @property
    def refused_lines(self) -> int:
        """How many packets were refused so far."""
        return self.reader.refused.total()

    def report_sharers(self, sharers: str) -> None:
        """Other programs have the port open: that is told beside what is wrong with the lidar."""
        self._sharers = sharers

    def expect_connection(self) -> None:
        """A port is about to be opened: ``wait_closed`` is to wait for its end."""
        self._closed.clear()

    async def wait_closed(self) -> None:
        """Wait until the expected connection has come and gone."""
        await self._closed.wait()

    def close(self) -> None:
        """Stop the scan and the motor of a lidar that takes commands, then close the port."""
        transport, words = self._transport, self.reader.end()
        if transport is None:
            return
        if words and isinstance(transport, PortTransport):
            transport.close_behind(words, dtr=True)
        else:
            transport.abort()

    @property
    def refused(self) -> Counter[str]:
        """What was passed over, by reason: bytes, packets and turns."""
        return self.reader.refused + Counter({"repeated_turn": self.repeated})

    # Inside

    @property
    def _poll_name(self) -> str:
        return f"{link_of(self.lidar)} poll"

    def _poll(self) -> None:
        """A reader that waits for an answer looks at the time."""
        if self._transport is None or self.lidar.model in (LidarModel.LD06, LidarModel.LD19):
            return
        self._say(self.reader.poll(self._clock.now_s()))
        self._poll_timer = self._clock.call_later(POLL_EVERY_S, self._poll, self._poll_name)

    def _say(self, words: bytes) -> None:
        if words and self._transport is not None:
            self._transport.write(words)
            if self._clock.recording:
                self._clock.publish(LinkBytesWritten(self._clock.now_s(), link_of(self.lidar), words))

    def _heard(self) -> LidarTotals:
        repeated = self.repeated + self.reader.refused["out_of_order"]
        reader = self.reader
        return LidarTotals(
            self.bytes_in, reader.packets, self.scans, repeated, self._heard_s, reader.awaits_scan
        )

    def _report_condition(self, condition: str, reason: str, *, healthy: bool | None) -> None:
        device, is_open = self.lidar.device, self.is_open
        now_s = self._clock.now_s()
        self._bus.publish(LidarChanged(now_s, self.lidar.name, device, is_open, healthy, condition, reason))
