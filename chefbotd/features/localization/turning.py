"""Turns a robot with an unknown pose once on the spot, if a client or the configuration allows it.

It drives as navigation does: by the same source, with its lease and dead-man, limits and guards. Whoever takes over, a
stop, a goal or a robot that is not armed ends the turn; nothing turns again by itself.
"""

import asyncio
import math
from typing import Final

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import OdometryUpdated, SafetyChanged
from chefbotd.core.events.navigation import NavigationChanged
from chefbotd.core.geometry import Twist2D, wrap_angle
from chefbotd.entries import Timer, entries_of
from chefbotd.features.driving.inner_driver import InnerDriver
from chefbotd.rpc.method import Unserved
from chefbotd.worker.requests import OnProgress as Report

LOOKS_S: Final = 3.0
"""It stands and looks for so long before it turns."""

EVERY_S: Final = 0.1
TURN: Final = Twist2D(0.0, 0.4)
AT_MOST_S: Final = 30.0
"""A turn takes 16 s where nothing is in its way."""

REPORT_S: Final = 1.0
"""A client waits for 5 s for what is silent."""

ARMED: Final = "armed"
ON_ITS_WAY: Final = ("planning", "driving", "recovering", "paused")


class Turning:
    """One turn at a time; ``driver`` puts it through the gate. Without one this robot does not drive by itself."""

    RESTORABLE_TIMERS = ("_go_on",)

    def __init__(self, bus: Bus, clock: Clock, driver: InnerDriver | None, report: Report) -> None:
        """``report`` is told how far it has turned."""
        self._driver, self._report, self._entries = driver, report, entries_of(clock)
        self._safety: SafetyChanged | None = None
        self._has_goal = False
        self._timer: Timer | None = None
        self._end: asyncio.Future[str] | None = None
        self._turns_until_s = self._reported_s = 0.0
        self._stops = 0
        self._heading_rad: float | None = None
        self._turned_rad = 0.0
        bus.add_handler(self._take_odometry, OdometryUpdated)
        bus.add_handler(self._take_safety, SafetyChanged)
        bus.add_handler(self._take_navigation, NavigationChanged)

    def require(self) -> InnerDriver:
        """The driver, if the robot may turn now.

        Raises:
            Refused: why it may not.
        """
        safety = self._safety
        if self._driver is None:
            raise Refused(RefusalKind.UNKNOWN_SOURCE, "this robot has no source navigation to turn by")
        if safety is not None and safety.mode != ARMED:
            kind = RefusalKind.ESTOPPED if safety.mode == "estopped" else RefusalKind.DISARMED
            raise Refused(kind, f"the robot is {safety.mode} ({safety.reason}); send 'arm' first")
        if self._has_goal:
            told = "the robot has a goal and cannot turn now; send cancel_navigation first"
            raise Refused(RefusalKind.STOPPED, told)
        if safety is not None and self._driver.gives_way_to(safety.source):
            raise Refused(RefusalKind.STOPPED, f"{safety.source} drives; the robot does not turn meanwhile")
        return self._driver

    def begin(self, *, is_asked: bool) -> "asyncio.Future[str]":
        """Turn once, after a moment of looking; what comes of it is a sentence. ``is_asked``: no stop holds it.

        Raises:
            Refused: the robot may not.
        """
        driver = self.require()
        if is_asked:
            driver.begin()
        if self._end is None or self._end.done():
            self._end = asyncio.get_running_loop().create_future()
            self._turned_rad, self._stops = 0.0, driver.stops
            self._turns_until_s = self._entries.now_s() + LOOKS_S + AT_MOST_S
            self._timer = self._entries.call_later(LOOKS_S, self._go_on, "localization turn")
        return self._end

    def end(self, why: str) -> None:
        """Come to rest; nothing happens where it does not turn."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._end is None or self._end.done():
            return
        self._end.set_result(why)
        if self._driver is not None:
            self._driver.let_go()

    def _go_on(self) -> None:
        self._timer = None
        if self._driver is None or self._turned_rad >= math.tau:
            self.end("it has turned once")
            return
        now_s = self._entries.now_s()
        if why := self._why_not(self._driver, now_s):
            self.end(why)
            return
        if now_s - self._reported_s >= REPORT_S:
            self._reported_s = now_s
            self._report(self._turned_rad, math.tau, "turns on the spot")
        self._timer = self._entries.call_later(EVERY_S, self._go_on, "localization turn")

    def _why_not(self, driver: InnerDriver, now_s: float) -> str:
        """Turn on, or say why not."""
        if driver.stops != self._stops:
            return f"it turns no more: {driver.source} was stopped by {driver.stopped_by or 'somebody'}"
        if now_s >= self._turns_until_s:
            return f"it could not turn once within {AT_MOST_S:.0f} s"
        try:
            driver.drive(TURN, now_s)
        except (Refused, Unserved) as held:
            return f"it turns no more: {held}"
        return ""

    def _take_odometry(self, event: OdometryUpdated) -> None:
        heading_rad, before_rad = event.odom_from_base.heading_rad, self._heading_rad
        self._heading_rad = heading_rad
        if self._timer is not None and before_rad is not None:
            self._turned_rad += wrap_angle(heading_rad - before_rad)

    def _take_safety(self, event: SafetyChanged) -> None:
        self._safety = event
        if event.mode != ARMED:
            self.end(f"it turns no more: the robot is {event.mode} ({event.reason})")
        elif self._driver is not None and self._driver.gives_way_to(event.source):
            self.end(f"it turns no more, for {event.source} took over")

    def _take_navigation(self, event: NavigationChanged) -> None:
        self._has_goal = event.state in ON_ITS_WAY
        if self._has_goal:
            self.end("it turns no more, for it has a goal")
