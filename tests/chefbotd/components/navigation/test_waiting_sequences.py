"""Random sequences of goals and turns that wait, of stops, faults and arms: no motion is older than the last stop.

Dispatcher, navigation, localization, leases and gate are the real ones; the worker is slow, and tells old wishes.
``make sequences SEQUENCES=1000000`` runs more of them.
"""

import asyncio
import json
import os
import random
from types import SimpleNamespace
from typing import Any, cast

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.localization.turning import TURN
from chefbotd.components.navigation.commands import NavigationCommands
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.service import NavigationService
from chefbotd.components.navigation.skill_requests import NavigateTo
from chefbotd.components.worker.service import WorkerService
from chefbotd.core.events import LinkOpened
from chefbotd.core.geometry import Motion, Pose2D, Twist2D, WheelDuties
from chefbotd.driving.commands import DriveCommands
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.driving.service import DriveService
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.process.latch_file import LatchFile
from chefbotd.rpc.arrivals import Arrivals
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.method import methods_of
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session
from chefbotd.safety.watchdog import ControlParameters, WatchdogParameters
from tests.chefbotd.components.navigation.bench import FakeWorker
from tests.chefbotd.driving.rig import CHASSIS
from tests.chefbotd.driving.test_stop_sequences import DRIVE, ENCODERS, FAULT, SAFETY
from tests.fakes.sequences import run_sequences

LENGTH = 14

DEEDS = (
    *("goal", "goal", "queued goal", "turn", "decide", "send what was decided"),
    *("stop", "estop", "fault", "arm", "arm", "arm"),
    *("busy", "ready", "step", "step", "wait", "wait long", "cancel", "resume", "reconnect"),
)


class Announcing(DriveService):
    """Takes commands and tells of the gate as ever, and steps no wheel."""

    def _obey(self, now_s: float) -> None:
        self.keeper.publish_gate_state(now_s)


class WatchedDriver(InnerDriver):
    """Navigation's driver; ``moved`` has each motion that the gate has let through."""

    moved: list[Motion | WheelDuties]

    def drive(self, motion: Motion | WheelDuties, wished_s: float) -> None:
        """As ever."""
        super().drive(motion, asyncio.get_running_loop().time())
        self.moved.append(motion)


class SlowWorker(FakeWorker):
    """Answers localization, too, after ``busy_s``."""

    async def request(self, skill: str, body: Any, answer: type[Any], **options: Any) -> Any:
        """As navigation's; it searches all the time."""
        await super().request(skill, body, answer, deadline_s=1.0)
        is_navigation = answer is not LocalizationChanged
        return None if is_navigation else LocalizationChanged(1.0, "searching", "flat", 0.0, (), 0.0, 0, "")


class Daemon:
    """What moves, stops and waits in a daemon; ``stops`` counts what has stopped the robot, as the test sees it."""

    def __init__(self) -> None:
        bus, clock = Bus(), LoopClock()
        keeper = SafetySupervisor(
            bus,
            clock,
            SAFETY,
            mounts={"front": Pose2D(0.15)},
            latch=LatchFile(None),
            session=5,
            motors=MotorWatch(SAFETY, CHASSIS, 1000),
        )
        self.driving = Announcing(
            bus,
            clock,
            lambda duty: None,
            DRIVE,
            keeper,
            reader=WheelReader(CHASSIS, ENCODERS, SameSideParameters()),
            wheel_names=("left", "right"),
            control=ControlParameters(),
            watchdog=WatchdogParameters(),
        )
        bus.publish(LinkOpened(clock.now_s(), "board"))
        keeper.publish_gate_state(clock.now_s())
        leases = ControlLeases(3.0, 1.0, self.driving.release, lambda event: None)
        self.driver = WatchedDriver(self.driving, leases, clock, "navigation", ("teleop", "safety"))
        self.turner = WatchedDriver(self.driving, leases, clock, "safety")
        self.driver.moved, self.turner.moved = [], []
        self.worker = SlowWorker()
        feed = cast("WorkerService", SimpleNamespace(worker=self.worker))
        places: Any = SimpleNamespace(places=None)
        self.navigation = NavigationService(bus, clock, feed, self.driver, places, NavigationSection())
        localization = LocalizationService(bus, clock, feed, self.turner)
        preview: Any = SimpleNamespace(of_twist=None, of_wheels=None)
        sources = tuple(SAFETY.sources)
        moving = DriveCommands(self.driving, preview, leases, clock, sources=sources, default_source="teleop")
        rows = (
            *methods_of(moving),
            *methods_of(NavigationCommands(self.navigation)),
            *methods_of(localization),
        )
        arrivals = Arrivals(clock)
        keeper.call_on_latched(lambda: arrivals.record_stop(None, "a fault"))
        self._dispatcher = Dispatcher(
            {row.name: row for row in rows},
            clock,
            arrivals,
            0.5,
            stop_number=lambda: self.driving.stop_number,
        )
        self._connect()
        self.stops, self.goals = 0, list[int]()  # by their x in metres: the stops before each was asked for
        self.turn_asked_at = -1
        self._decided: tuple[int, int] | None = None
        self._told = 0

    def _connect(self) -> None:
        session = Session(ApiParameters(requests_burst=10**6), "10.0.0.7", 1, Role.ADMIN, 0.0)
        session.number = getattr(self, "_connections", 0) + 1
        self._connections = session.number
        ignore = lambda *words, **options: None  # noqa: E731
        self._caller: Any = SimpleNamespace(
            session=session, reply=ignore, send_progress=ignore, send_event=ignore, end=ignore
        )

    def call(self, method: str, **params: Any) -> None:
        """A request, as it comes from the socket."""
        request = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
        self._dispatcher.serve(self._caller, json.dumps(request).encode())

    async def do(self, deed: str) -> None:
        """One step, and a moment for what follows."""
        if deed in ("goal", "queued goal"):
            self.goals.append(self.stops)
            self.call("navigate_to", x_m=len(self.goals) - 1.0, y_m=0.0, queue=deed == "queued goal")
        elif deed == "decide":
            self._decided = self.stops, self.driving.stop_number
        elif deed == "send what was decided" and self._decided is not None:
            stops, number = self._decided
            self.goals.append(stops)
            self.call("navigate_to", x_m=len(self.goals) - 1.0, y_m=0.0, if_stop_number=number)
        elif deed == "turn":
            self.turn_asked_at = self.stops
            self.call("localize", turn=True)
        elif deed in ("stop", "estop"):
            self.stops += 1
            self.call(deed)
        elif deed == "fault":
            was_armed = self.driving.keeper.armed
            self.driving.fail(FAULT)
            self.stops += was_armed
        elif deed in ("arm", "cancel", "resume"):
            self.call({"cancel": "cancel_navigation", "resume": "resume_navigation"}.get(deed, deed))
        elif deed == "busy":
            self.worker.busy_s = 2.0
        elif deed == "ready":
            self.worker.busy_s = 0.0
        elif deed == "reconnect":
            self._connect()
        elif deed == "step":
            self._step()
        await asyncio.sleep({"wait": 1.0, "wait long": 5.0}.get(deed, 0.01))
        self._check_turn()

    def _step(self) -> None:
        """The worker wishes to move to the goal that it was told of last: it may not know yet that it has ended."""
        orders = [each for each in self.worker.received if isinstance(each, NavigateTo)]
        if not orders:
            return
        goal = orders[-1].goals[0]
        self.driver.moved.clear()
        self.worker.step(goal.number)
        if Twist2D(0.2, 0.1) in self.driver.moved:
            assert self.goals[round(goal.x_m)] == self.stops, "a goal from before a stop moves the robot"

    def _check_turn(self) -> None:
        if TURN in self.turner.moved:
            assert self.turn_asked_at == self.stops, "a turn from before a stop moves the robot"
        self.turner.moved.clear()


async def one(choose: random.Random) -> bool:
    """A random sequence; whether a goal has moved the robot."""
    daemon = Daemon()
    sending = asyncio.create_task(daemon.navigation.run())
    deeds = choose.choices(DEEDS, k=LENGTH)
    has_moved = False
    try:
        for count, deed in enumerate(deeds, 1):
            try:
                await daemon.do(deed)
            except AssertionError as failure:
                raise AssertionError(f"{failure}: {', '.join(deeds[:count])}") from None
            has_moved = has_moved or bool(daemon.driver.moved)
    finally:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(sending, *others, return_exceptions=True)
    return has_moved


@pytest.mark.parametrize(
    "number", [150, pytest.param(int(os.environ.get("SEQUENCES", "100000")), marks=pytest.mark.slow)]
)
def test_nothing_moves_that_was_asked_for_before_a_stop_or_a_fault(number: int) -> None:
    """Whatever waited for a worker, in a queue or in a client; and a share of the sequences does move the robot."""
    assert sum(run_sequences(one, number, seed=37)) > number / 50
