"""Carries out a step's procedure: each motion goes through the gate, and ends when a stop does, or anything else.

It drives as navigation does: by a source of its own, with its lease and dead-man, limits and guards.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.calibration.algorithms.step import Action, Ask, Measurements, Move, Procedure
from chefbotd.components.calibration.measuring import Gathering, join_measurements
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import SafetyChanged, WheelsMeasured
from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.inputs import Timer, inputs_of
from chefbotd.safety.gate import Mode, not_armed

PERIOD_S: Final = 0.05
REST_S: Final = 0.3
REST_RAD_S: Final = 0.02
"""The robot is at rest when no wheel was faster for ``REST_S``."""

SETTLE_TIMEOUT_S: Final = 3.0
ANSWER_TIMEOUT_S: Final = 300.0
STEP_TIMEOUT_S: Final = 900.0
SILENT_S: Final = 2.0
"""Without a reading of the wheels for so long the step ends."""

ALIVE_S: Final = 1.0
"""How often what goes on is reported: a client gives up after 5 s of silence."""

BLOCKED_S: Final = 1.0
"""A step ends when an obstacle limits the motion and the wheels stand for so long: it is in the way.

A robot that is only slowed goes on. In a flat that happens to most robots in the step ``wheels``: the ultrasonic sensor
slows them from 0.31 to 0.15 m/s in front of a wall that they stop 0.6 m away from. What they drive is measured as it is.
"""

TIMER: Final = "calibration"

Report = Callable[[Action], None]


class ProcedureRunnerState(MutableState):
    """What decides whether a step may begin; one that is under way is not continued in a replay."""

    drives: bool = False
    safety: SafetyChanged | None = None
    wheels: WheelsMeasured | None = None
    blocked_since_s: float | None = None


class StopBaseline(Record, frozen=True):
    """How many stops there had been when a step was asked for, and the number of the last stop or fault."""

    stops: int
    stop_number: int


class ProcedureRunner(StatefulPart[ProcedureRunnerState]):
    """Runs one procedure at a time; ``report`` is called with each action as it begins."""

    def __init__(self, bus: Bus, clock: Clock, driver: InnerDriver, report: Report) -> None:
        self._bus, self._entries, self._driver, self._report = bus, inputs_of(clock), driver, report
        self.memory, self.parts = ProcedureRunnerState(), {"drives": driver}
        self._answer: asyncio.Future[float] | None = None
        self._asked: Ask | None = None
        self._timer: Timer | None = None
        bus.add_handler(self._take_safety, SafetyChanged)
        bus.add_handler(self._take_wheels, WheelsMeasured)

    def require(self) -> None:
        """Nothing is in the way of driving.

        Raises:
            Refused: the robot is not armed, or somebody else drives.
        """
        safety = self._armed()
        if safety.source not in (None, self._driver.source):
            raise Refused(
                RefusalKind.STOPPED,
                Sentence(
                    "calibration.other_drives",
                    "{source} drives the robot; end that first",
                    source=safety.source,
                ),
            )

    def _armed(self) -> SafetyChanged:
        """The gate's state; raises ``Refused`` where the robot is not armed."""
        safety = self.memory.safety
        if safety is None:
            raise not_armed("", "it is not known yet whether the robot may move")
        if safety.mode != Mode.ARMED:
            raise not_armed(safety.mode, safety.reason)
        return safety

    def answer(self, key: str, value: float) -> None:
        """Answer the question that is open.

        Raises:
            Refused: there is none of this key, or the value is out of its bounds.
        """
        asked, future = self._asked, self._answer
        if asked is None or future is None or future.done() or asked.key != key:
            raise Refused(
                RefusalKind.OUT_OF_RANGE,
                Sentence("calibration.not_asked", "calibration does not ask for {key!a} now", key=key),
            )
        if not asked.lowest <= value <= asked.highest:
            expected = Sentence(
                "calibration.out_of_range",
                "{key} is {value:g}, expected {lowest:g} to {highest:g} {unit}",
                key=key,
                value=value,
                lowest=asked.lowest,
                highest=asked.highest,
                unit=asked.unit,
            )
            raise Refused(RefusalKind.OUT_OF_RANGE, expected)
        future.set_result(value)

    def take_baseline(self) -> StopBaseline:
        """To be asked for when a step is: any stop or fault after it ends the step, also before its first motion."""
        return StopBaseline(self._driver.stops, self._driver.stop_number)

    async def run(self, procedure: Procedure, baseline: StopBaseline) -> Measurements:
        """Everything that was measured during the procedure.

        Raises:
            Refused: something ended it: a stop, a fault, somebody who took over, a sensor that fell silent.
        """
        self._check_stopped(baseline)
        self.require()
        gathering, parts = Gathering(self._bus), []
        self._driver.begin(baseline.stop_number, "this step was asked for")
        end_s = self._entries.now_s() + STEP_TIMEOUT_S
        try:
            action = next(procedure, None)
            while action is not None:
                self._report(action)
                gathering.with_scans = not isinstance(action, Ask)
                answers = await self._perform(action, baseline)
                parts.append(gathering.take(answers))
                if self._entries.now_s() > end_s:
                    raise Refused(
                        RefusalKind.STOPPED,
                        Sentence(
                            "calibration.took_long",
                            "the step took longer than {seconds:.0f} s",
                            seconds=STEP_TIMEOUT_S,
                        ),
                    )
                try:
                    action = procedure.send(parts[-1])
                except StopIteration:
                    action = None
        finally:
            procedure.close()
            self._driver.let_go()
            gathering.end()
            if self._timer is not None:
                self._timer.cancel()
        return join_measurements(parts)

    async def _perform(self, action: Action, baseline: StopBaseline) -> Mapping[str, float]:
        if isinstance(action, Ask):
            return {action.key: await self._ask_person(action, baseline)}
        await self._move(action, baseline)
        return {}

    async def _move(self, move: Move, baseline: StopBaseline) -> None:
        now_s = began_s = reported_s = self._entries.now_s()
        while now_s - began_s < move.duration_s:
            self._check(baseline, now_s)
            if move.motion is not None:
                self._driver.drive(move.motion, now_s)
            if now_s - reported_s >= ALIVE_S:
                reported_s = now_s
                self._report(move)
            await self._sleep(min(PERIOD_S, began_s + move.duration_s - now_s + 1e-6))
            now_s = self._entries.now_s()
        if move.motion is not None and move.settled:
            self._driver.let_go()
            await self._settle(baseline)

    async def _settle(self, baseline: StopBaseline) -> None:
        """Wait until the wheels are at rest."""
        began_s = rest_s = self._entries.now_s()
        while True:
            await self._sleep(PERIOD_S)
            now_s = self._entries.now_s()
            self._check(baseline, now_s)
            if not _is_at_rest(self.memory.wheels):
                rest_s = now_s
            if now_s - rest_s >= REST_S:
                return
            if now_s - began_s > SETTLE_TIMEOUT_S:
                raise Refused(
                    RefusalKind.STOPPED,
                    self._not_at_rest(),
                )

    def _check(self, baseline: StopBaseline, now_s: float) -> None:
        """Raise ``Refused`` if the step must end."""
        safety = self._check_stopped(baseline)
        self.require()
        memory, wheels = self.memory, self.memory.wheels
        if memory.blocked_since_s is not None and not _is_at_rest(wheels):
            memory.blocked_since_s = now_s
        if memory.blocked_since_s is not None and now_s - memory.blocked_since_s > BLOCKED_S:
            raise Refused(
                RefusalKind.STOPPED,
                Sentence(
                    "calibration.in_the_way",
                    "something is in the way ({obstacle}); make room, and try again",
                    obstacle=safety.limited_by,
                ),
            )
        if wheels is None or now_s - wheels.arrival_s > SILENT_S:
            raise Refused(
                RefusalKind.LINK_DOWN,
                Sentence(
                    "calibration.silent",
                    "the board has not told of its wheels for {seconds:.0f} s",
                    seconds=SILENT_S,
                ),
            )

    def _not_at_rest(self) -> Sentence:
        """That the wheels go on; with what a board without an echo does, where that is why they do not obey."""
        if self.memory.safety is None or self.memory.safety.limited_by not in ("no_echo", "encoders_stale"):
            return Sentence(
                "calibration.not_at_rest",
                "the wheels did not come to rest within {seconds:.0f} s",
                seconds=SETTLE_TIMEOUT_S,
            )
        return Sentence(
            "calibration.not_at_rest_without_echo",
            "the wheels did not come to rest within {seconds:.0f} s: the board tells of them once a second only, "
            "as it waits for an echo; calibrate where something stands within 4 m ahead of the robot",
            seconds=SETTLE_TIMEOUT_S,
        )

    def _check_stopped(self, baseline: StopBaseline) -> SafetyChanged:
        """The gate's state; raises ``Refused`` after any stop or fault, also after one that is cleared already."""
        if self._driver.stops != baseline.stops:
            who = self._driver.stopped_by or "somebody"
            raise Refused(
                RefusalKind.STOPPED,
                Sentence("calibration.stopped", "the calibration was stopped by {who}", who=who),
            )
        safety = self._armed()
        if self._driver.stop_number != baseline.stop_number:
            raise Refused(
                RefusalKind.STOPPED,
                Sentence("calibration.fault", "a fault stopped the robot meanwhile; begin the step again"),
            )
        return safety

    async def _ask_person(self, ask: Ask, baseline: StopBaseline) -> float:
        self._driver.let_go()
        self._asked, self._answer = ask, asyncio.get_running_loop().create_future()
        end_s = self._entries.now_s() + ANSWER_TIMEOUT_S
        try:
            while not self._answer.done():
                if self._entries.now_s() >= end_s:
                    late = Sentence(
                        "calibration.nobody_answered",
                        "nobody answered within {minutes:.0f} minutes",
                        minutes=ANSWER_TIMEOUT_S / 60,
                    )
                    raise Refused(RefusalKind.STOPPED, late)
                await self._sleep(ALIVE_S)
                self._check_stopped(baseline)
                self._report(ask)
            return self._answer.result()
        finally:
            self._asked = self._answer = None

    async def _sleep(self, seconds: float) -> None:
        wake = asyncio.Event()
        self._timer = self._entries.call_later(seconds, wake.set, TIMER)
        await wake.wait()

    def _take_safety(self, event: SafetyChanged) -> None:
        self.memory.safety = event
        if not (event.limited_by or "").startswith("obstacle"):
            self.memory.blocked_since_s = None
        elif self.memory.blocked_since_s is None:
            self.memory.blocked_since_s = event.stamp_s

    def _take_wheels(self, event: WheelsMeasured) -> None:
        self.memory.wheels = event


def _is_at_rest(wheels: WheelsMeasured | None) -> bool:
    """Whether no wheel was measured to turn."""
    return wheels is not None and max(map(abs, wheels.velocity_rad_s)) <= REST_RAD_S
