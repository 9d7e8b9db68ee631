"""Drives a course over the command socket with feedback from odometry, and judges the result."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from msgspec import Struct, field

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive import turning
from chefbotd.cli.drive.control import release_source, send_drive
from chefbotd.cli.drive.course import (
    GoTo,
    Leg,
    TurnTo,
    deviation,
    remaining,
    remaining_rad,
    steer,
)
from chefbotd.cli.drive.timed_drive import pose, standing
from chefbotd.client import Client, Event, Subscription
from chefbotd.client.models import OdometryData
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import Record


class Ping(Record, frozen=True):
    """One ping: sent and received by our clock, answered with a stamp of the daemon's clock."""

    sent_s: float
    received_s: float
    stamp_s: float

    @property
    def round_trip_s(self) -> float:
        """From request to answer."""
        return self.received_s - self.sent_s

    @property
    def clock_offset_s(self) -> float:
        """The daemon's clock minus ours, assuming equal delay both ways; off by half a round trip at most."""
        return self.stamp_s - (self.sent_s + self.received_s) / 2


class Latencies(Struct):
    """Pings and arrivals on a connection; an arrival is our time and the daemon's stamp of an event."""

    pings: list[Ping] = field(default_factory=list)
    arrivals: list[tuple[float, float]] = field(default_factory=list)

    def round_trips_s(self) -> list[float]:
        """Of every ping."""
        return [ping.round_trip_s for ping in self.pings]

    def ages_s(self) -> list[float]:
        """Of every event when it arrived, the clocks compared by the quickest ping (as NTP does)."""
        if not self.pings:
            return []
        clock_offset_s = min(self.pings, key=lambda ping: ping.round_trip_s).clock_offset_s
        return [received_s + clock_offset_s - stamp_s for received_s, stamp_s in self.arrivals]


def percentile(values: Sequence[float], percent: float) -> float:
    """The nearest-rank percentile, always one of the values; not a number when there are none."""
    if not values:
        return math.nan
    rank = math.ceil(percent / 100 * len(values))
    return sorted(values)[max(rank, 1) - 1]


PING_PERIOD_S = 0.1
FIRST_ODOMETRY_TIMEOUT_S = 10.0
"""A daemon that has just started has to open its device, and the board to boot."""

ODOMETRY_TIMEOUT_S = 2.0
SETTLING_S = 0.5
NEARER_M = 0.005
PATIENCE_S, TIME_LIMIT_S = 10.0, 600.0
"""A side fails when the robot comes no nearer to its end for so long; a course fails when it takes longer."""

ALLOWED_DISTANCE_M = 0.05
ALLOWED_HEADING_RAD = math.radians(5)


class LegEnd(Record, frozen=True):
    """The end of a leg: the commanded pose, the pose by odometry, and the true pose (simulated robots only)."""

    name: str
    commanded: Pose2D
    odometric: Pose2D
    true: Pose2D | None


class CourseProgress(Record, frozen=True):
    """Progress along a course: legs done, name and completed share (0 to 1) of the present leg, pose by odometry."""

    leg: int
    legs: int
    name: str
    share: float
    odometric: Pose2D


class CourseResult(Record, frozen=True):
    """A finished course. The last mark was made after the robot stood."""

    marks: tuple[LegEnd, ...]
    seconds: float
    latencies: Latencies


Report = Callable[[CourseProgress], None]
DriveStep = Callable[[Twist2D], Awaitable[None]]
"""Command a twist, and wait for the next odometry."""


class _Track(Struct):
    """A topic's poses, seen from where the first one was."""

    start: Pose2D | None = None
    latest: Pose2D = field(default_factory=Pose2D)

    def update(self, at: Pose2D) -> None:
        self.start = self.start or at
        self.latest = self.start.inverse().compose(at)


class CourseDriver:
    """Drives a robot along a course, from wherever it stands."""

    def __init__(
        self,
        robot: Client,
        report: Report,
        *,
        patience_s: float = PATIENCE_S,
        time_limit_s: float = TIME_LIMIT_S,
    ) -> None:
        self._robot, self._report = robot, report
        self._patience_s, self._time_limit_s = patience_s, time_limit_s
        self._tracks = {"odometry": _Track(), "sim": _Track()}
        self._odometry = self._tracks["odometry"]
        self._standing = True
        self._delay_s = turning.FIRST_DELAY_S
        self._latencies = Latencies()

    async def drive_course(self, legs: Sequence[Leg]) -> CourseResult:
        """Drive the legs and brake to standstill, after an error and a cancellation too. Other drivers may go on.

        Raises:
            ProgramError: odometry stopped coming, or the course took longer than ``time_limit_s``.
            ChefbotError: as the client raises them.
        """
        topics = [t for t in self._tracks if t in (await self._robot.describe()).topics]
        loop = asyncio.get_running_loop()
        async with self._robot.subscribe(topics, policy="ordered") as events:
            await self._first_values(events, topics)
            began_s = loop.time()
            try:
                async with asyncio.timeout(self._time_limit_s):
                    marks = [await self._follow(events, legs, index) for index in range(len(legs))]
            except TimeoutError as error:
                limit = f"{self._time_limit_s:g} s"
                raise ProgramError(Exit.NOT_DONE, f"the course was not finished within {limit}") from error
            finally:
                await release_source(self._robot)
            seconds = loop.time() - began_s
            await self._wait_for_standstill(events)
        return CourseResult((*marks, self._mark("at rest", legs[-1])), seconds, self._latencies)

    async def _first_values(self, events: Subscription[Any], topics: Sequence[str]) -> None:
        try:
            async with asyncio.timeout(
                FIRST_ODOMETRY_TIMEOUT_S + ODOMETRY_TIMEOUT_S
            ):  # covers topics other than odometry
                while any(self._tracks[topic].start is None for topic in topics):
                    await self._next(events, FIRST_ODOMETRY_TIMEOUT_S)
        except TimeoutError as error:
            missing = " and ".join(topic for topic in topics if self._tracks[topic].start is None)
            raise ProgramError(
                Exit.NOT_DONE, f"no {missing} for {FIRST_ODOMETRY_TIMEOUT_S + ODOMETRY_TIMEOUT_S:g} s"
            ) from error

    async def _follow(self, events: Subscription[Any], legs: Sequence[Leg], index: int) -> LegEnd:
        """Drive until the leg is done and the robot stands, so that no turn begins with speed left over."""
        leg, name = legs[index], _name(legs, index)
        whole = remaining(leg, self._odometry.latest)

        async def drive_step(asked: Twist2D) -> None:
            await send_drive(self._robot, asked)
            await self._ping_if_due()
            await self._next(events, ODOMETRY_TIMEOUT_S)
            share = 1 - remaining(leg, self._odometry.latest) / whole if whole else 1.0
            self._report(CourseProgress(index, len(legs), name, share, self._odometry.latest))

        try:
            await (
                self._drive_side(leg, drive_step) if isinstance(leg, GoTo) else self._turn(leg, drive_step)
            )
        except ProgramError as error:
            raise ProgramError(error.code, f"{name}: {error}{await self._limit_suffix()}") from error
        return self._mark(name, leg)

    async def _drive_side(self, leg: GoTo, drive_step: DriveStep) -> None:
        """Drive a side; fails when the robot comes no nearer to its end for ``patience_s``."""
        loop = asyncio.get_running_loop()
        nearest_m, nearer_s = math.inf, loop.time()
        while (twist := steer(leg, self._odometry.latest)) or not self._standing:
            remaining_m = remaining(leg, self._odometry.latest)
            if remaining_m < nearest_m - NEARER_M:
                nearest_m, nearer_s = remaining_m, loop.time()
            if loop.time() - nearer_s > self._patience_s:
                reason = f"{remaining_m:.2f} m are left, and no nearer for {self._patience_s:g} s"
                raise ProgramError(Exit.NOT_DONE, reason)
            await drive_step(twist or STANDING)

    async def _turn(self, leg: TurnTo, drive_step: DriveStep) -> None:
        """Turn in place. The delay that this turn learned is used for the next one."""
        loop = asyncio.get_running_loop()
        turn = turning.begin(loop.time(), remaining_rad(leg, self._odometry.latest), self._delay_s)
        while True:
            angle_rad = remaining_rad(leg, self._odometry.latest)
            turn, rate = turning.step(turn, loop.time(), angle_rad, stands=self._standing)
            if rate is None:
                self._delay_s = turn.delay_s
                return
            await drive_step(Twist2D(0.0, rate))

    async def _limit_suffix(self) -> str:
        """What slows or stops the robot according to the daemon, to append to a sentence; may be empty."""
        safety = (await self._robot.get_state()).safety
        held_by = safety.limited_by or (None if safety.mode == "armed" else safety.reason)
        return "" if held_by is None else f"; slowed by {held_by}"

    async def _wait_for_standstill(self, events: Subscription[Any]) -> None:
        """Wait until the robot has stood for ``SETTLING_S``, so that late readings have arrived."""
        loop = asyncio.get_running_loop()
        stood_since_s = loop.time()
        while loop.time() - stood_since_s < SETTLING_S:
            await self._next(events, ODOMETRY_TIMEOUT_S)
            stood_since_s = stood_since_s if self._standing else loop.time()

    async def _next(self, events: Subscription[Any], patience_s: float) -> None:
        """Read events up to and including the next one of odometry."""
        try:
            async with asyncio.timeout(patience_s):
                while (event := await anext(events)).topic != "odometry":
                    self._tracks[event.topic].update(pose(event.data))
        except TimeoutError as error:
            raise ProgramError(Exit.NOT_DONE, f"no odometry for {patience_s:g} s") from error
        self._take_odometry(event)

    def _take_odometry(self, odometry: Event[OdometryData]) -> None:
        self._odometry.update(pose(odometry.data))
        self._standing = standing(odometry.data)
        self._latencies.arrivals.append((asyncio.get_running_loop().time(), odometry.stamp_s))

    async def _ping_if_due(self) -> None:
        loop, pings = asyncio.get_running_loop(), self._latencies.pings
        sent_s = loop.time()
        if not pings or sent_s - pings[-1].sent_s >= PING_PERIOD_S:
            stamp_s = (await self._robot.ping()).stamp_s
            pings.append(Ping(sent_s, loop.time(), stamp_s))

    def _mark(self, name: str, leg: Leg) -> LegEnd:
        true = self._tracks["sim"]
        return LegEnd(
            name, leg.target, self._tracks["odometry"].latest, None if true.start is None else true.latest
        )


def _name(legs: Sequence[Leg], index: int) -> str:
    kind = type(legs[index])
    ordinal = sum(isinstance(leg, kind) for leg in legs[: index + 1])
    return f"{'side' if kind is GoTo else 'turn'} {ordinal}"


def problems(result: CourseResult) -> list[str]:
    """The problems with the final pose; empty when there are none."""
    end = result.marks[-1]
    texts = []
    closing = deviation(end.commanded, end.odometric)
    if not closing.within(ALLOWED_DISTANCE_M, ALLOWED_HEADING_RAD):
        texts.append(f"odometry says that the robot ended {closing} from the goal")
    if end.true is not None:
        drift = deviation(end.true, end.odometric)
        if not drift.within(ALLOWED_DISTANCE_M, ALLOWED_HEADING_RAD):
            texts.append(f"the robot really ended {drift} from where odometry says")
    return texts
