"""A lidar as seen from its wire: bytes in, scans and health out; requests out where it wants any."""

import asyncio
from collections import Counter
from typing import cast

import structlog
from msgspec import field

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import OdometryUpdated
from chefbotd.core.events.inputs import LinkBytesWritten
from chefbotd.core.events.lidars import LidarChanged, ScanMeasured
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import join_sentences
from chefbotd.inputs import ResumableTimer, inputs_of
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


class LidarSessionState(MutableState):
    """What the session remembers of its lidar, but for the port itself; ``due_s`` is when it is polled next."""

    reader: Ld19State | RplidarState
    repeats: RepeatFinder = field(default_factory=RepeatFinder)
    travel: Travel = field(default_factory=Travel)
    health: LidarHealthWatch = field(default_factory=lambda: LidarHealthWatch(0.0, LidarTotals()))
    sample: bytes = b""
    due_s: float | None = None
    heard_s: float = 0.0
    bytes_in: int = 0
    opens: int = 0
    scans: int = 0
    scans_before: int = 0
    repeated: int = 0
    turn_s: float | None = None
    sharers: str = ""


class LidarSession(asyncio.Protocol, StatefulPart[LidarSessionState]):
    """An asyncio protocol that survives reconnections and keeps its counters. It publishes each scan when it ends."""

    def __init__(self, bus: Bus, clock: Clock, lidar: LidarParameters) -> None:
        self._bus, self._clock, self.lidar = bus, inputs_of(clock), lidar
        self.reader = _reader_of(lidar)
        self._base_from_lidar = lidar.base_from_lidar
        bus.add_handler(self._add_travel, OdometryUpdated)
        self._transport: asyncio.Transport | None = None
        self._closed = asyncio.Event()
        self._closed.set()
        self._poll_timer = ResumableTimer(self._clock, self._poll, f"{link_of(lidar)} poll")
        self.memory = LidarSessionState(self.reader.memory)
        self.parts = {"reader": self.reader, "due_s": self._poll_timer}

    def restore(self, state: LidarSessionState) -> None:
        """Go on from there; the port is open already, where it was. Raises ``TypeError`` for another model's state."""
        if type(state.reader) is not type(self.reader.memory):
            raise TypeError(f"the state is not that of {self.lidar.model}")
        super().restore(state)

    # What asyncio tells us

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A port was opened: nothing is known of it yet."""
        self._transport = cast(asyncio.Transport, transport)
        now_s = self._clock.now_s()
        self.memory.opens += 1
        self.memory.scans_before, self.memory.sample = self.memory.scans, b""
        self.memory.health = LidarHealthWatch(now_s, self._heard())
        self._say(self.reader.begin(now_s))
        self._report_condition(UNKNOWN, "", healthy=None)
        self._poll()

    def connection_lost(self, exc: Exception | None) -> None:
        """The port is gone."""
        self._transport = None
        self._poll_timer.cancel()
        self._report_condition(DOWN, str(exc) if exc else "closed", healthy=False)
        self._closed.set()

    def data_received(self, data: bytes) -> None:
        """Stamp, read, publish what is whole, and ask for what comes next."""
        now_s = self._clock.now_s()
        self.memory.bytes_in, self.memory.heard_s = self.memory.bytes_in + len(data), now_s
        self.memory.sample = (self.memory.sample + data[-SAMPLE_BYTES:])[-SAMPLE_BYTES:]
        for turn in self.reader.read_bytes(data, now_s):
            self._take_turn(turn)
        self._say(self.reader.poll(now_s))

    def _take_turn(self, turn: LidarTurn) -> None:
        """Publish a turn, unless it repeats an older one: then it is no measurement."""
        if self.memory.repeats.is_repeated(turn, self.memory.travel.travelled_m):
            self.memory.repeated += 1
            return
        scan = scan_of(self.lidar, turn)
        self.memory.scans += 1
        self.memory.turn_s = float(turn.stamp_s[-1] - turn.stamp_s[0])
        self._bus.publish(ScanMeasured(scan.stamp_s, self.lidar.name, self._base_from_lidar, scan))

    def _add_travel(self, odometry: OdometryUpdated) -> None:
        self.memory.travel.add_twist(odometry.stamp_s, odometry.twist)

    # What the link asks

    @property
    def is_open(self) -> bool:
        """Whether a port is connected."""
        return self._transport is not None

    @property
    def is_proven(self) -> bool:
        """Whether a whole turn has come in since the port was opened."""
        return self.memory.scans > self.memory.scans_before

    def judge_health(self) -> None:
        """Look at what has come in lately; a change is published and logged. Call it a few times a second."""
        health = self.memory.health.look(
            self._clock.now_s(), self._heard(), self.memory.sample, self.reader.complaint
        )
        if health is None or not self.is_open:
            return
        healthy = health.condition is LidarCondition.HEALTHY
        reason = "" if healthy else join_sentences((health.reason, self.memory.sharers))
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
        self.memory.sharers = sharers

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
        return self.reader.refused + Counter({"repeated_turn": self.memory.repeated})

    # Inside

    def _poll(self) -> None:
        """A reader that waits for an answer looks at the time."""
        if self._transport is None or self.lidar.model in (LidarModel.LD06, LidarModel.LD19):
            return
        self._say(self.reader.poll(self._clock.now_s()))
        self._poll_timer.start(POLL_EVERY_S)

    def _say(self, words: bytes) -> None:
        if words and self._transport is not None:
            self._transport.write(words)
            if self._clock.recording:
                self._clock.publish(LinkBytesWritten(self._clock.now_s(), link_of(self.lidar), words))

    def _heard(self) -> LidarTotals:
        repeated = self.memory.repeated + self.reader.refused["out_of_order"]
        reader = self.reader
        return LidarTotals(
            self.memory.bytes_in,
            reader.packets,
            self.memory.scans,
            repeated,
            self.memory.heard_s,
            reader.awaits_scan,
        )

    def _report_condition(self, condition: str, reason: str, *, healthy: bool | None) -> None:
        device, is_open = self.lidar.device, self.is_open
        now_s = self._clock.now_s()
        self._bus.publish(LidarChanged(now_s, self.lidar.name, device, is_open, healthy, condition, reason))
