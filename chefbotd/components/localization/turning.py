"""Turns a robot with an unknown pose once on the spot, if a client or the configuration allows it.

It drives as navigation does: by the same source, with its lease and dead-man, limits and guards. Whoever takes over, a
stop, a goal or a robot that is not armed ends the turn; nothing turns again by itself.
"""

import asyncio
import math
from typing import Final

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.worker.requests import OnProgress as Report
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import OdometryReset, OdometryUpdated, SafetyChanged
from chefbotd.core.geometry import Twist2D, wrap_angle
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.inputs import ResumableTimer, inputs_of
from chefbotd.rpc.method import Unserved
from chefbotd.safety.gate import Mode, not_armed, why_not_armed

LOOKS_S: Final = 3.0
"""It stands and looks for so long before it turns."""

EVERY_S: Final = 0.1
TURN: Final = Twist2D(0.0, 0.4)
AT_MOST_S: Final = 30.0
"""A turn takes 16 s where nothing is in its way."""

REPORT_S: Final = 1.0
"""A client waits for 5 s for what is silent."""

ARMED: Final = "armed"


TIMER: Final = "localization turn"


class TurningState(MutableState):
    """How far a turn is, and what decides whether the robot may turn; ``due_s`` is when it goes on.

    ``why_ended`` is None while a turn is under way, and empty before the first. ``was_stopped``: somebody has stopped
    the robot, or it had a fault, since the daemon started.
    """

    drives: bool = False
    safety: SafetyChanged | None = None
    has_goal: bool = False
    due_s: float | None = None
    why_ended: str | None = ""
    turns_until_s: float = 0.0
    reported_s: float = 0.0
    stops: int = 0
    heading_rad: float | None = None
    turned_rad: float = 0.0
    was_stopped: bool = False


class Turning(StatefulPart[TurningState]):
    """One turn at a time; ``driver`` puts it through the gate. Without one this robot does not drive by itself."""

    def __init__(self, bus: Bus, clock: Clock, driver: InnerDriver | None, report: Report) -> None:
        """``report`` is called with how far it has turned."""
        self._driver, self._report, self._entries = driver, report, inputs_of(clock)
        self._timer = ResumableTimer(self._entries, self._go_on, TIMER)
        self.memory = TurningState()
        self.parts = {"due_s": self._timer} if driver is None else {"due_s": self._timer, "drives": driver}
        self._end: asyncio.Future[str] | None = None
        bus.add_handler(self._take_odometry, OdometryUpdated)
        bus.add_handler(self._take_reset, OdometryReset)
        bus.add_handler(self._take_safety, SafetyChanged)

    def state(self) -> TurningState:
        """Return the state of this part."""
        end = self._end
        self.memory.why_ended = "" if end is None else end.result() if end.done() else None
        return super().state()

    def restore(self, state: TurningState) -> None:
        """Restore this state."""
        super().restore(state)
        self._end = None if state.why_ended == "" else asyncio.get_running_loop().create_future()
        if self._end is not None and state.why_ended is not None:
            self._end.set_result(state.why_ended)

    def require(self) -> InnerDriver:
        """The driver, if the robot may turn now.

        Raises:
            Refused: why it may not.
        """
        safety = self.memory.safety
        if self._driver is None:
            raise Refused(
                RefusalKind.UNKNOWN_SOURCE,
                Sentence("localization.cannot_turn", "this robot is not set up to turn by itself"),
            )
        if safety is not None and safety.mode != ARMED:
            raise not_armed(safety.mode, safety.reason)
        if self.memory.has_goal:
            reason = Sentence(
                "localization.has_goal", "the robot has a goal and cannot turn now; cancel the goal first"
            )
            raise Refused(RefusalKind.STOPPED, reason)
        if safety is not None and self._driver.gives_way_to(safety.source):
            raise Refused(
                RefusalKind.STOPPED,
                Sentence(
                    "localization.other_drives",
                    "{source} drives; the robot does not turn meanwhile",
                    source=safety.source,
                ),
            )
        return self._driver

    def begin(self, stop_number: int | None = None) -> "asyncio.Future[str]":
        """Turn once, after a moment of looking; what comes of it is a sentence.

        ``stop_number`` is the driver's when somebody asked for the turn; None: nobody did, and stops hold it.

        Raises:
            Refused: the robot may not.
        """
        driver = self.require()
        if stop_number is not None:
            driver.begin(stop_number, "this turn was asked for")
        if self._end is None or self._end.done():
            self._end = asyncio.get_running_loop().create_future()
            self.memory.turned_rad, self.memory.stops = 0.0, driver.stops
            self.memory.turns_until_s = self._entries.now_s() + LOOKS_S + AT_MOST_S
            self._timer.start(LOOKS_S)
        return self._end

    def end(self, why: str) -> None:
        """Come to rest; nothing happens where it does not turn."""
        self._timer.cancel()
        if self._end is None or self._end.done():
            return
        self._end.set_result(why)
        if self._driver is not None:
            self._driver.let_go()

    def _go_on(self) -> None:
        if self._driver is None or self.memory.turned_rad >= math.tau:
            self.end(Sentence("localization.turned_once", "it has turned once"))
            return
        now_s = self._entries.now_s()
        if why := self._why_not(self._driver, now_s):
            self.end(why)
            return
        if now_s - self.memory.reported_s >= REPORT_S:
            self.memory.reported_s = now_s
            self._report(self.memory.turned_rad, math.tau, "turns on the spot")
        self._timer.start(EVERY_S)

    def _why_not(self, driver: InnerDriver, now_s: float) -> str:
        """Turn on, or say why not."""
        if driver.stops != self.memory.stops:
            stopped_by = driver.stopped_by or Sentence("localization.somebody", "somebody")
            return Sentence(
                "localization.stopped",
                "it turns no more: {source} was stopped by {by}",
                source=driver.source,
                by=stopped_by,
            )
        if now_s >= self.memory.turns_until_s:
            return Sentence(
                "localization.no_turn_in_time",
                "it could not turn once within {seconds:.0f} s",
                seconds=AT_MOST_S,
            )
        try:
            driver.drive(TURN, now_s)
        except (Refused, Unserved) as held:
            return Sentence(
                "localization.turns_no_more",
                "it turns no more: {why}",
                why=held.words if isinstance(held, Refused) else held,
            )
        return ""

    def _take_odometry(self, event: OdometryUpdated) -> None:
        heading_rad, before_rad = event.odom_from_base.heading_rad, self.memory.heading_rad
        self.memory.heading_rad = heading_rad
        if self._end is not None and before_rad is not None and self._timer.due_s is not None:
            self.memory.turned_rad += wrap_angle(heading_rad - before_rad)

    def _take_reset(self, event: OdometryReset) -> None:
        self.memory.heading_rad = event.after.heading_rad

    def _take_safety(self, event: SafetyChanged) -> None:
        before, self.memory.safety = self.memory.safety, event
        has_stopped = before is not None and event.stop_number != before.stop_number
        self.memory.was_stopped = (
            self.memory.was_stopped or has_stopped or event.mode in (Mode.DISARMED, Mode.ESTOPPED)
        )
        if event.mode != ARMED:
            why = why_not_armed(event.mode, event.reason)
            self.end(Sentence("localization.turns_no_more", "it turns no more: {why}", why=why))
        elif self._driver is not None and self._driver.gives_way_to(event.source):
            self.end(
                Sentence(
                    "localization.taken_over", "it turns no more, for {source} took over", source=event.source
                )
            )

    def note_goal(self, *, has_goal: bool) -> None:
        """Know whether the robot has a goal: then it does not turn."""
        self.memory.has_goal = has_goal
        if has_goal:
            self.end(Sentence("localization.got_goal", "it turns no more, for it has a goal"))
