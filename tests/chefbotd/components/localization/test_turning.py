"""A turn on the spot to find out where the robot is, on the simulated robot: it passes the gate as navigation does."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from types import SimpleNamespace
from typing import cast

import pytest

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.models import LocalizeParams
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.localization.turning import LOOKS_S, Turning
from chefbotd.components.worker.service import WorkerService
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot


class Bench:
    """A turn in the running daemon."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, daemon, clock = robot, robot.daemon, LoopClock()
        self.reports: list[float] = []
        driver = InnerDriver(daemon.driving, daemon.leases, clock, "navigation", ("teleop", "safety"))
        self.turning = Turning(daemon.bus, clock, driver, lambda done, total, text: self.reports.append(done))
        self.sources: set[str | None] = set()
        daemon.bus.add_handler(lambda event: self.sources.add(event.source), SafetyChanged)

    @property
    def truth(self) -> object:
        return self.robot.board.truth(asyncio.get_running_loop().time())

    @property
    def turn_rad_s(self) -> float:
        return abs(float(self.truth.twist.angular_rad_s))  # type: ignore[attr-defined]

    async def until_turning(self) -> None:
        await asyncio.sleep(LOOKS_S + 1.0)
        assert self.turn_rad_s > 0.3


def on_robot(scenario: Callable[[Bench], Awaitable[None]]) -> None:
    """Run a scenario on the simulated ChefBot, armed."""

    async def run() -> None:
        async with simulated_robot() as robot:
            bench = Bench(robot)
            await robot.client.arm()  # whoever listens from now on hears how the gate stands
            await asyncio.sleep(1.0)
            await scenario(bench)

    run_virtual(run())


def test_it_looks_for_three_seconds_and_turns_once_round() -> None:
    """Then it has turned by a whole turn and what braking takes, as the source navigation, and stands."""

    async def scenario(bench: Bench) -> None:
        began_s = asyncio.get_running_loop().time()
        end = bench.turning.begin(bench.turning.require().stop_number)
        await asyncio.sleep(LOOKS_S - 0.1)
        assert bench.turn_rad_s < 0.01
        assert await end == "it has turned once"
        took_s = asyncio.get_running_loop().time() - began_s
        assert LOOKS_S + math.tau / 0.4 < took_s < LOOKS_S + math.tau / 0.4 + 2.0
        assert "navigation" in bench.sources
        await asyncio.sleep(1.0)
        assert bench.turn_rad_s < 0.005
        assert bench.reports[-1] == pytest.approx(math.tau, abs=0.5)
        assert len(bench.reports) > 10

    on_robot(scenario)


def test_a_reset_of_the_odometry_is_no_rotation() -> None:
    """Half a turn that is only declared, twice, leaves a whole turn to be made, and all of it is made."""

    async def scenario(bench: Bench) -> None:
        began_s = asyncio.get_running_loop().time()
        end = bench.turning.begin(bench.turning.require().stop_number)
        await bench.until_turning()
        for heading_rad in (3.0, 0.0, 3.0):
            await bench.robot.client.reset_odometry(0.0, 0.0, heading_rad)
            await asyncio.sleep(0.5)
        assert await end == "it has turned once"
        took_s = asyncio.get_running_loop().time() - began_s
        assert LOOKS_S + math.tau / 0.4 < took_s < LOOKS_S + math.tau / 0.4 + 2.0

    on_robot(scenario)


async def _stop(bench: Bench) -> None:
    await bench.robot.client.stop()


async def _estop(bench: Bench) -> None:
    await bench.robot.client.estop("a test")


async def _disarm(bench: Bench) -> None:
    bench.robot.daemon.bus.publish(SafetyChanged(1.0, "disarmed", "the link was lost", None))


async def _teleop(bench: Bench) -> None:
    await bench.robot.client.drive(0.0, 0.0, "teleop")


async def _goal(bench: Bench) -> None:
    bench.turning.note_goal(has_goal=True)


async def _found(bench: Bench) -> None:
    bench.turning.end("it knows where it is")


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (_stop, "was stopped by"),
        (_estop, "the emergency stop is on"),
        (_disarm, "the robot is stopped"),
        (_teleop, "teleop took over"),
        (_goal, "it has a goal"),
        (_found, "it knows where it is"),
    ],
)
@pytest.mark.parametrize("is_turning", [True, False])
def test_whatever_ends_a_turn_ends_it_for_good(
    happens: Callable[[Bench], Awaitable[None]], why: str, *, is_turning: bool
) -> None:
    """Also while it only looks: then it never begins to turn. When all is over, it does not go on."""

    async def scenario(bench: Bench) -> None:
        end = bench.turning.begin(bench.turning.require().stop_number)
        if is_turning:
            await bench.until_turning()
        else:
            await asyncio.sleep(1.0)
        await happens(bench)
        assert why in await asyncio.wait_for(end, LOOKS_S + 0.1)
        await asyncio.sleep(1.0)
        assert bench.turn_rad_s < 0.005
        await asyncio.sleep(LOOKS_S + 1.0)
        assert bench.turn_rad_s < 0.005

    on_robot(scenario)


def test_a_robot_that_may_not_turn_says_why() -> None:
    """Disarmed, driven by a person, on its way to a goal, or without a source to drive by."""

    async def scenario(bench: Bench) -> None:
        turning, client = bench.turning, bench.robot.client
        await client.drive(0.0, 0.0, "teleop")
        with pytest.raises(Refused, match="teleop drives"):
            turning.begin()
        await client.release_control()
        await _goal(bench)
        with pytest.raises(Refused, match="cancel the goal first"):
            turning.begin()
        await _disarm(bench)
        with pytest.raises(Refused, match="arm the robot first"):
            turning.begin()
        with pytest.raises(Refused, match="not set up to turn"):
            Turning(bench.robot.daemon.bus, LoopClock(), None, lambda *told: None).begin()

    on_robot(scenario)


def test_a_client_that_drives_as_navigation_is_not_disturbed() -> None:
    """It has the lease: the turn ends before it begins."""

    async def scenario(bench: Bench) -> None:
        end = bench.turning.begin(bench.turning.require().stop_number)
        await asyncio.sleep(LOOKS_S - 0.2)
        for _ in range(5):
            await bench.robot.client.drive(0.0, 0.0, "navigation")
            await asyncio.sleep(0.1)
        assert "take control" in await asyncio.wait_for(end, 0.5)
        assert bench.turn_rad_s < 0.01

    on_robot(scenario)


class BusyWorker:
    """Takes a while for a search, in which ``happens``."""

    is_ready = True

    def __init__(self, happens: Callable[[], Awaitable[object]]) -> None:
        self._happens = happens

    def add_listener(self, *_: object) -> None:
        """Nothing is told."""

    def add_on_ready(self, _: object) -> None:
        """It is ready all the time."""

    async def request(self, *_: object, **__: object) -> LocalizationChanged:
        await self._happens()
        return LocalizationChanged(1.0, "searching", "flat", 0.0, (), 0.0, 0, "")


async def _fault(bench: Bench) -> None:
    bench.robot.daemon.driving.fail(Fault(FaultKind.WHEEL_STALLED, "a test"))


@pytest.mark.parametrize("happens", [_stop, _estop, _fault])
def test_a_stop_while_the_worker_begins_to_search_is_not_undone(
    happens: Callable[[Bench], Awaitable[None]],
) -> None:
    """Somebody stops the robot after the turn was asked for and before it began: it never turns, also once armed."""

    async def scenario(bench: Bench) -> None:
        daemon, clock = bench.robot.daemon, LoopClock()
        driver = InnerDriver(daemon.driving, daemon.leases, clock, "navigation", ("teleop", "safety"))

        async def meanwhile() -> None:
            await happens(bench)
            await bench.robot.client.arm()

        feed = cast(WorkerService, SimpleNamespace(worker=BusyWorker(meanwhile)))
        service = LocalizationService(daemon.bus, clock, feed, driver)
        with pytest.raises(Refused, match="stopped after this turn was asked for"):
            await service.localize(
                cast(Caller, None), LocalizeParams(turn=True), cast(ProgressReporter, None)
            )
        await asyncio.sleep(LOOKS_S + 2.0)
        assert bench.turn_rad_s < 0.005

    on_robot(scenario)


@pytest.mark.parametrize("happens", [None, _stop, _estop, _fault])
def test_a_robot_that_was_stopped_since_its_start_does_not_turn_by_itself(
    happens: Callable[[Bench], Awaitable[None]] | None,
) -> None:
    """It is to turn once where it does not know where it is; what stopped it before, and an arm, end that permission."""

    async def scenario(bench: Bench) -> None:
        daemon, clock = bench.robot.daemon, LoopClock()
        driver = InnerDriver(daemon.driving, daemon.leases, clock, "navigation", ("teleop", "safety"))
        feed = cast(WorkerService, SimpleNamespace(worker=BusyWorker(lambda: asyncio.sleep(0))))
        service = LocalizationService(daemon.bus, clock, feed, driver, turns_at_start=True)
        await bench.robot.client.stop()  # whoever listens from now on hears how the gate stands
        service._turning.was_stopped = False
        if happens is not None:
            await happens(bench)
            await bench.robot.client.arm()
        service._take_told(LocalizationChanged(1.0, "searching", "flat", 0.0, (), 0.0, 0, ""))
        await asyncio.sleep(LOOKS_S + 2.0)
        assert (bench.turn_rad_s > 0.3) is (happens is None)

    on_robot(scenario)
