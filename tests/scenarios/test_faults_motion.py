"""Every fault of motion on the simulated robot: what stops it, how soon, how it is told, and how it is left again."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.core.events import BatteryCounted, EncodersCounted
from chefbotd.process.build import ServiceLost
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.robots import ROBOTS, SKETCHED, settings_of
from tests.scenarios.wires import Rewrite, frozen, jumping, reversed_from_now, rewire

STILL_M_S = 0.005
on_every_board = pytest.mark.parametrize(
    "robot_name", [*ROBOTS, *(pytest.param(each, marks=pytest.mark.slow) for each in SKETCHED[1:])]
)

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


def on_robot(name: str, scenario: Scenario, **overrides: object) -> None:
    """Run a scenario with the robot up; overrides are ``section__key``."""
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}

    async def run() -> None:
        async with simulated_robot(settings_of(name, dotted)) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def drive(
    robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float
) -> float | None:
    """Repeat a command at 20 Hz until it is refused: when that was, in seconds (None: never)."""
    start_s = asyncio.get_running_loop().time()
    for _ in range(round(seconds / 0.05)):
        try:
            await robot.client.drive(linear_m_s, angular_rad_s)
        except CallError as refusal:
            if refusal.kind != "disarmed":
                raise
            return asyncio.get_running_loop().time() - start_s
        await asyncio.sleep(0.05)
    return None


async def safety(robot: SimulatedRobot) -> dict[str, object]:
    """The topic's latest data."""
    return (await robot.client.call("get_state"))["safety"]


def speed_m_s(robot: SimulatedRobot) -> float:
    """How fast the robot really goes."""
    return abs(robot.board.truth(0.0).twist.linear_m_s)


async def left_by_arm(robot: SimulatedRobot, fault: str) -> str:
    """It is latched, told, and at rest; after arming nothing jumps, and then it drives. Returns the reason."""
    told = await safety(robot)
    assert (told["armed"], told["fault"]) == (False, fault)
    await asyncio.sleep(0.5)
    assert not any(robot.board.duty)
    await robot.client.arm()
    await asyncio.sleep(0.3)
    assert not any(robot.board.duty)
    assert speed_m_s(robot) < STILL_M_S
    assert await drive(robot, 0.2, 0.0, 1.0) is None
    assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
    return told["reason"]


@on_every_board
@pytest.mark.parametrize(
    ("broken", "fault", "within_s", "advice"),
    sample(
        [
            (frozen, "wheel_stalled", 2.2, "its encoder is plugged in"),
            (reversed_from_now, "wheel_reversed", 0.6, "wired backwards"),
            (jumping, "encoder_jumps", 0.5, "loose contact"),
        ],
        fast=2,
    ),
)
@pytest.mark.parametrize("wheel", sample([1, 0]))
def test_a_broken_encoder_stops_the_robot(
    robot_name: str, broken: Callable[[int], Rewrite], fault: str, within_s: float, advice: str, wheel: int
):
    """While driving: disarmed within its time, at rest, the wheel named and what to check said; arming leaves it."""

    async def scenario(robot: SimulatedRobot) -> None:
        names = (await robot.client.call("get_state"))["topics"]["wheels"]["data"]["name"]
        feed = robot.device.transport.feed
        await drive(robot, 0.2, 0.0, 1.0)
        rewire(robot, b"e", broken(wheel))
        stopped_s = await drive(robot, 0.2, 0.0, 5.0)
        assert stopped_s is not None
        assert stopped_s <= within_s
        robot.device.transport.feed = feed
        reason = await left_by_arm(robot, fault)
        assert reason.startswith(names[wheel])
        assert advice in reason

    on_robot(robot_name, scenario)


@on_every_board
def test_swapped_encoders_are_noticed_when_turning(robot_name: str):
    """Left and right exchanged: on the spot each wheel seems to turn the wrong way."""

    async def scenario(robot: SimulatedRobot) -> None:
        rewire(robot, b"e", lambda counts: counts[::-1])
        assert await drive(robot, 0.0, 1.0, 3.0) is not None
        assert (await safety(robot))["fault"] == "wheel_reversed"

    on_robot(robot_name, scenario)


@on_every_board
def test_a_second_of_silence_stops_the_robot_and_does_not_latch(robot_name: str):
    """As when an echo is missing: zero within 0.25 s and a watch period, told as a limit, and then it drives on."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        feed = robot.device.transport.feed
        robot.device.transport.feed = lambda data: None
        assert await drive(robot, 0.2, 0.0, 0.35) is None
        assert not any(robot.board.duty)
        told = await safety(robot)
        assert (told["armed"], told["limited_by"]) == (True, "encoders_stale")
        assert await drive(robot, 0.2, 0.0, 0.65) is None
        assert speed_m_s(robot) < STILL_M_S
        robot.device.transport.feed = feed
        assert await drive(robot, 0.2, 0.0, 1.0) is None
        assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
        assert (await safety(robot))["limited_by"] is None

    on_robot(robot_name, scenario)


@on_every_board
def test_a_board_that_goes_on_saying_nothing_is_a_fault(robot_name: str):
    """Two seconds after the last reading of a drive that it interrupted."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        feed = robot.device.transport.feed
        robot.device.transport.feed = lambda data: None
        stopped_s = await drive(robot, 0.2, 0.0, 5.0)
        assert stopped_s == pytest.approx(2.0, abs=0.1)
        robot.device.transport.feed = feed
        assert "check that the board runs" in await left_by_arm(robot, "encoders_silent")

    on_robot(robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_a_critical_battery_disarms(robot_name: str):
    """Five seconds of 0.3 V below the threshold, and a stop; a second of it, two seconds earlier, is nothing."""
    battery = load(packaged(robot_name)).battery
    voltage_v = battery.critical_v - 0.3
    adc = b"%.2f" % (voltage_v / (battery.reference_v * battery.divider_ratio) * battery.adc_full_scale)

    async def scenario(robot: SimulatedRobot) -> None:
        feed = robot.device.transport.feed
        for seconds in (1.0, 10.0):
            rewire(robot, b"b", lambda _: [adc])
            stopped_s = await drive(robot, 0.1, 0.3, seconds)
            robot.device.transport.feed = feed
            await drive(robot, 0.1, 0.3, 2.0)  # longer than the filter remembers
        assert stopped_s == pytest.approx(5.05, abs=0.1)
        assert f"{voltage_v:.1f} V" in await left_by_arm(robot, "battery_critical")

    on_robot(robot_name, scenario)


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", ROBOTS)
def test_the_guard_keeps_the_robot_off_the_wall_and_lets_it_leave(robot_name: str):
    """Driven at a wall it comes to rest between the stop distance and 5 cm more; turning and backing off go on.

    There KHAN's infrared sensor is at its fold: it may say that it cannot tell near from far, which holds it up as well.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        assert await drive(robot, 0.3, 0.0, 20.0) is None
        truth = robot.board.truth(0.0)
        assert not truth.in_contact
        assert speed_m_s(robot) < STILL_M_S
        beam = (await robot.client.call("get_state"))["topics"]["ranges"]["data"]["ranges"][0]
        assert beam["status"] in {"chefbot": ("ok",), "khan": ("ok", "too_near", "ambiguous")}[robot_name]
        assert 0.14 <= (beam["range_m"] or beam["min_range_m"]) <= 0.20
        assert (await safety(robot))["limited_by"] == "obstacle:front"
        await drive(robot, 0.0, 0.8, 1.5)
        assert robot.board.truth(0.0).twist.angular_rad_s == pytest.approx(0.8, rel=0.1)
        await drive(robot, -0.2, 0.0, 1.0)
        assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(-0.2, rel=0.05)
        assert (await safety(robot))["limited_by"] is None

    on_robot(robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("service", sample(["odometry", "sensors", "stats"]))
def test_a_service_whose_task_is_cancelled_stops_the_robot_and_comes_back(robot_name: str, service: str):
    """Zero before the service runs again; it is named, and armed again all is as it was."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        next(task for task in asyncio.all_tasks() if task.get_name() == service).cancel()
        stopped_s = await drive(robot, 0.2, 0.0, 1.0)
        assert stopped_s <= 0.05
        assert f"'{service}'" in await left_by_arm(robot, "service_failed")

    on_robot(robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_a_service_that_raises_stops_the_robot_and_comes_back(robot_name: str):
    """A reading that breaks the sensors' service: the next one is interpreted again."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        robot.daemon.bus.publish(BatteryCounted(0.0, 0.0, "full"))
        assert await drive(robot, 0.2, 0.0, 1.0) <= 0.05
        assert "TypeError" in await left_by_arm(robot, "service_failed")
        assert (await robot.client.call("get_state"))["topics"]["battery"]["age_s"] < 0.1

    on_robot(robot_name, scenario)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("ending", sample(["six failures", "control", "link"]))
def test_what_cannot_go_on_ends_with_a_stop(robot_name: str, ending: str):
    """Six failures within a minute, or the loss of a part that cannot be missed: the daemon ends, after a stop."""

    async def run() -> None:
        async with simulated_robot(load(packaged(robot_name))) as robot:
            await asyncio.sleep(1.0)
            await drive(robot, 0.2, 0.0, 1.0)
            assert any(robot.board.duty)
            if ending == "six failures":
                for _ in range(6):
                    robot.daemon.bus.publish(BatteryCounted(0.0, 0.0, "full"))
                    await asyncio.sleep(0.1)
            else:
                name = "drive" if ending == "control" else "link"
                next(task for task in asyncio.all_tasks() if task.get_name() == name).cancel()
            await asyncio.sleep(0.1)
            assert not any(robot.board.duty)

    with pytest.raises(ExceptionGroup) as failures:
        run_virtual(run())
    assert failures.group_contains(ServiceLost)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_an_error_in_the_control_loop_stops_the_robot_and_the_loop_lives_on(robot_name: str):
    """Counts for a wheel that there is not: disarmed in the same turn of the loop, and armed again it drives."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        now_s = asyncio.get_running_loop().time()
        robot.daemon.bus.publish(EncodersCounted(now_s, now_s, now_s, (1, 2, 3, 4, 5)))
        assert await drive(robot, 0.2, 0.0, 1.0) <= 0.05
        assert "ValueError" in await left_by_arm(robot, "internal_error")

    on_robot(robot_name, scenario)


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize(
    "world",
    sample(
        [
            {"sim__true__left_slip": 0.15, "sim__true__right_slip": 0.05},
            {},
            {"sim__board__cycle_s": 0.05},
            {"sim__battery__resistance_ohm": 0.15},
        ]
    ),
    ids=["slip", "as it is", "20 Hz", "sagging battery"],
)
def test_healthy_driving_is_never_taken_for_a_fault(robot_name: str, world: dict[str, object]):
    """Starts, stops, reversals at full speed, crawling, turning: nothing latches."""
    moves = [
        (0.34, 0.0),
        (-0.34, 0.0),
        (0.0, 2.0),
        (0.0, -2.0),
        (0.03, 0.0),
        (-0.03, 0.1),
        (0.5, 1.0),
        (-0.2, -1.5),
    ]

    async def scenario(robot: SimulatedRobot) -> None:
        for linear_m_s, angular_rad_s in moves * 2:
            assert await drive(robot, linear_m_s, angular_rad_s, 1.2) is None
        assert (await safety(robot))["fault"] is None

    on_robot(robot_name, scenario, **world)
