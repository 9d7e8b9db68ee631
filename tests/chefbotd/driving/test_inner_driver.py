"""A driver inside the daemon on the simulated robot: its wishes pass the gate as anybody's commands do."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.client import CallError
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged, WheelsDriven
from chefbotd.core.geometry import Twist2D
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.rpc.method import Unserved
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

WISH = Twist2D(0.14, 0.2)
STEP_S = 0.05


class Navigation:
    """The driver, and who wishes the same twenty times a second."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot = robot
        self.driver = InnerDriver(robot.daemon.driving, robot.daemon.leases, LoopClock(), "navigation")
        self.changes = robot.daemon.bus.subscribe(SafetyChanged, size=200)
        self.duties: list[WheelsDriven] = []
        robot.daemon.bus.add_handler(self.duties.append, WheelsDriven)

    async def wish(self, seconds: float, twist: Twist2D = WISH, *, late_s: float = 0.0) -> None:
        loop = asyncio.get_running_loop()
        end_s = loop.time() + seconds
        while loop.time() < end_s:
            self.driver.drive(twist, loop.time() - late_s)
            await asyncio.sleep(STEP_S)

    def sources(self) -> list[str | None]:
        return [self.changes.take_event().source for _ in range(len(self.changes))]

    @property
    def speed_m_s(self) -> float:
        return self.robot.board.truth(asyncio.get_running_loop().time()).twist.linear_m_s


def on_robot(scenario: Callable[[Navigation], Awaitable[None]]) -> None:
    """Run a scenario on the simulated ChefBot, armed."""

    async def run() -> None:
        async with simulated_robot() as robot:
            await asyncio.sleep(1.0)
            await scenario(Navigation(robot))

    run_virtual(run())


def test_wishes_drive_the_robot_as_the_source_navigation() -> None:
    """The topic safety names the source, and the true speed becomes the one that is wished."""

    async def scenario(navigation: Navigation) -> None:
        await navigation.wish(1.5)
        assert navigation.sources()[-1] == "navigation"
        assert navigation.speed_m_s == pytest.approx(0.14, abs=0.02)
        assert (await navigation.robot.client.get_state()).safety.mode == "armed"

    on_robot(scenario)


def test_without_wishes_the_dead_man_brakes() -> None:
    """Half a second after the last wish (safety.command_timeout_s) the setpoint falls, and 0.5 s later it stands."""

    async def scenario(navigation: Navigation) -> None:
        await navigation.wish(1.5)
        await asyncio.sleep(0.35)
        assert navigation.speed_m_s > 0.1
        await asyncio.sleep(0.65)
        assert abs(navigation.speed_m_s) < 0.005
        assert not any(navigation.duties[-1].duty)

    on_robot(scenario)


def test_letting_go_brings_it_to_rest_before_the_dead_man_would() -> None:
    """A goal that was reached or cancelled: at rest within 0.35 s."""

    async def scenario(navigation: Navigation) -> None:
        await navigation.wish(1.5)
        navigation.driver.let_go()
        await asyncio.sleep(0.35)
        assert abs(navigation.speed_m_s) < 0.01

    on_robot(scenario)


def test_a_wish_that_was_held_up_moves_nothing() -> None:
    """What was wished 0.4 s ago was wished by what was seen then."""

    async def scenario(navigation: Navigation) -> None:
        await navigation.wish(1.0, late_s=0.4)
        assert abs(navigation.speed_m_s) < 0.005
        assert "navigation" not in navigation.sources()

    on_robot(scenario)


def test_teleop_takes_over_at_once_and_gives_back() -> None:
    """Within a control step the robot is teleop's; a second after teleop's last command (its timeout_s) it is ours."""

    async def scenario(navigation: Navigation) -> None:
        wishing = asyncio.create_task(navigation.wish(4.0))
        await asyncio.sleep(1.0)
        navigation.sources()
        await navigation.robot.client.drive(-0.05, 0.0, "teleop")
        await asyncio.sleep(STEP_S)
        assert navigation.sources()[-1] == "teleop"
        await asyncio.sleep(1.1)
        assert navigation.sources()[-1] == "navigation"
        await wishing

    on_robot(scenario)


def test_a_client_may_not_drive_as_navigation_while_a_goal_is_driven_and_may_take_it() -> None:
    """Refused as lease_held by name; after take_control our wishes are refused instead, and nobody drives by them."""

    async def scenario(navigation: Navigation) -> None:
        client = navigation.robot.client
        await navigation.wish(0.5)
        with pytest.raises(CallError, match="the robot's own navigation") as refused:
            await client.drive(0.1, 0.0, "navigation")
        assert refused.value.kind == "lease_held"
        await client.take_control("navigation")
        with pytest.raises(Unserved, match="navigation is controlled by"):
            await navigation.wish(0.1)

    on_robot(scenario)


def test_a_stop_holds_the_wishes_until_a_new_goal() -> None:
    """A client's stop ends the motion though wishes go on; only a goal that is asked for anew moves it again."""

    async def scenario(navigation: Navigation) -> None:
        await navigation.wish(1.0)
        await navigation.robot.client.stop()
        for _ in range(30):
            with pytest.raises(Refused, match="navigation was stopped by"):
                await navigation.wish(STEP_S)
            await asyncio.sleep(STEP_S)
        assert abs(navigation.speed_m_s) < 0.005
        navigation.driver.begin(navigation.driver.stop_number, "this was asked for")
        await navigation.wish(1.0)
        assert navigation.speed_m_s > 0.1

    on_robot(scenario)


async def _stop(robot: SimulatedRobot) -> None:
    await robot.client.stop()


async def _estop(robot: SimulatedRobot) -> None:
    await robot.client.estop()


async def _fail(robot: SimulatedRobot) -> None:
    robot.daemon.driving.fail(Fault(FaultKind.LINK_LOST, "the link was lost"))


@pytest.mark.parametrize("happens", [_stop, _estop, _fail])
def test_what_has_waited_does_not_begin_after_a_stop_or_fault_and_somebodys_arm(
    happens: Callable[[SimulatedRobot], Awaitable[None]],
) -> None:
    """A component that took its request before it, and begins after it, is refused; asked anew, it drives."""

    async def scenario(navigation: Navigation) -> None:
        asked_at = navigation.driver.stop_number
        await happens(navigation.robot)
        await navigation.robot.client.arm()
        with pytest.raises(Refused, match="stopped after this was asked for"):
            navigation.driver.begin(asked_at, "this was asked for")
        navigation.driver.begin(navigation.driver.stop_number, "this was asked for")
        await navigation.wish(1.0)
        assert navigation.speed_m_s > 0.1

    on_robot(scenario)
