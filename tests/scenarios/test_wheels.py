"""Wheels as such on the simulated robots: commanded each on its own, believed if the others of their side agree."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.robots import OBEYED_S, knowing_its_size
from tests.scenarios.wires import Rewrite, frozen, rewire, slipping

Scenario = Callable[[SimulatedRobot], Awaitable[None]]

LIFTED = {"sim.body.mass_kg": 0.0}
"""On a stand: the wheels hang free."""

STANDS = {"chefbot": {}, "khan": LIFTED}
"""ChefBot can turn one wheel on the ground, around the other; KHAN's would drag each other along."""

LEFT_AND_RIGHT = ["left_wheel", "right_wheel"]
FRONT_AND_REAR = ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]
WHEELS = [("chefbot", wheel) for wheel in LEFT_AND_RIGHT] + [("khan", wheel) for wheel in FRONT_AND_REAR]


def on_robot(settings: Settings, scenario: Scenario) -> None:
    """Run a scenario with the board up and the encoders coming in."""

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def turn(robot: SimulatedRobot, velocity_rad_s: Mapping[str, float], seconds: float) -> None:
    """Repeat a command of wheels at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.set_wheel_velocities(velocity_rad_s)
        await asyncio.sleep(0.05)


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a command of the whole robot at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.05)


async def topic(robot: SimulatedRobot, name: str) -> dict[str, object]:
    """A topic's latest data."""
    state = await robot.client.call("get_state")
    return state["topics"][name]["data"]


async def velocities(robot: SimulatedRobot) -> dict[str, float]:
    """How fast each wheel turns, by name."""
    wheels = await topic(robot, "wheels")
    return dict(zip(wheels["name"], wheels["velocity_rad_s"], strict=True))


async def mean_velocities(robot: SimulatedRobot, wanted: Mapping[str, float]) -> dict[str, float]:
    """How far each wheel turns within a second of such a command: finer than one reading, which is whole counts."""
    before = (await topic(robot, "wheels"))["position_rad"]
    await turn(robot, wanted, 1.0)
    wheels = await topic(robot, "wheels")
    turned = zip(wheels["name"], before, wheels["position_rad"], strict=True)
    return {name: after - start for name, start, after in turned}


async def pose_error(robot: SimulatedRobot) -> tuple[float, float]:
    """How far odometry is off the truth, in metres and in radians."""
    odometry, true = await topic(robot, "odometry"), robot.board.truth(0.0).world_from_base
    error_rad = math.remainder(odometry["heading_rad"] - true.heading_rad, math.tau)
    return math.dist((odometry["x_m"], odometry["y_m"]), (true.x_m, true.y_m)), abs(error_rad)


@pytest.mark.parametrize(("robot_name", "wheel"), sample([WHEELS[5], *WHEELS[:5]]))
@pytest.mark.parametrize("velocity_rad_s", sample([3.0, -5.0]))
def test_a_wheel_turns_as_it_is_told_and_the_others_stand(robot_name: str, wheel: str, velocity_rad_s: float):
    """From the third second on within 2 % in sign and size, the others at zero, and at rest after a stop."""

    async def scenario(robot: SimulatedRobot) -> None:
        await turn(robot, {wheel: velocity_rad_s}, 2.0)
        turning = await mean_velocities(robot, {wheel: velocity_rad_s})
        assert turning.pop(wheel) == pytest.approx(velocity_rad_s, rel=0.02)
        assert set(turning.values()) == {0.0}
        await robot.client.stop()
        await asyncio.sleep(1.5)
        assert not any(robot.board.duty)
        assert not any((await velocities(robot)).values())

    on_robot(load(packaged(robot_name), overrides=STANDS[robot_name]), scenario)


@pytest.mark.parametrize(
    ("robot_name", "velocity_rad_s"),
    [
        ("chefbot", {"left_wheel": 4.0, "right_wheel": 6.0}),
        ("chefbot", {"left_wheel": -3.0, "right_wheel": 3.0}),
        ("khan", dict(zip(FRONT_AND_REAR, [5.0, 7.0, 5.0, 7.0], strict=True))),
    ],
)
def test_on_the_ground_the_wheels_turn_as_told_too(robot_name: str, velocity_rad_s: dict[str, float]):
    """Each wheel within 2 % of its own speed, and then a twist takes over without the robot having to stop."""

    async def scenario(robot: SimulatedRobot) -> None:
        await turn(robot, velocity_rad_s, 2.0)
        assert await velocities(robot) == pytest.approx(velocity_rad_s, rel=0.02)
        await drive(robot, 0.15, 0.0, 1.5)
        assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(0.15, rel=0.02)

    on_robot(load(packaged(robot_name)), scenario)


def test_too_fast_wheels_keep_their_ratio():
    """ChefBot's rims reach 0.34 m/s: of 20 and 10 rad/s the wheels get 7.56 and 3.78, as the answer says at once."""

    async def scenario(robot: SimulatedRobot) -> None:
        answer = await robot.client.set_wheel_velocities({"right_wheel": 10.0, "left_wheel": 20.0})
        assert answer.limited_by == "drive.max_rim_speed_m_s"
        assert answer.name == ["right_wheel", "left_wheel"]
        assert answer.velocity_rad_s == pytest.approx([0.17 / 0.045, 0.34 / 0.045])
        await turn(robot, {"left_wheel": 20.0, "right_wheel": 10.0}, 2.0)
        target = dict(zip(LEFT_AND_RIGHT, (await topic(robot, "wheels"))["target_rad_s"], strict=True))
        assert target == pytest.approx({"left_wheel": 0.34 / 0.045, "right_wheel": 0.17 / 0.045})

    on_robot(load(overrides=LIFTED), scenario)


@pytest.mark.slow
def test_wheels_do_not_drive_the_robot_into_a_wall():
    """The guard computes from the wheels where the robot goes: it stands before the wall, and backs off when asked."""

    async def scenario(robot: SimulatedRobot) -> None:
        await turn(robot, {"left_wheel": 6.0, "right_wheel": 6.0}, 20.0)
        assert not robot.board.truth(0.0).in_contact
        assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(0.0, abs=0.005)
        assert (await topic(robot, "safety"))["limited_by"] == "obstacle:front"
        await turn(robot, {"left_wheel": -4.0, "right_wheel": -4.0}, 1.5)
        assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(-4.0 * 0.045, rel=0.02)

    on_robot(load(), scenario)


def test_wheel_commands_are_at_the_gates_mercy():
    """They end with the dead-man; an e-stop brakes them, latches, and refuses them by kind; unknown names too."""

    async def scenario(robot: SimulatedRobot) -> None:
        await turn(robot, {"left_wheel": 4.0}, 1.0)
        await asyncio.sleep(1.5)
        assert not any(robot.board.duty)
        with pytest.raises(CallError, match="'middle'; there are left_wheel, right_wheel") as refused:
            await robot.client.set_wheel_velocities({"left_wheel": 1.0, "middle": 1.0})
        assert refused.value.kind == "unknown_wheel"
        await turn(robot, {"left_wheel": 4.0}, 0.5)
        await robot.client.estop()
        await asyncio.sleep(OBEYED_S)
        assert not any(robot.board.duty)
        with pytest.raises(CallError) as refused:
            await robot.client.set_wheel_velocities({"left_wheel": 1.0})
        assert refused.value.kind == "estopped"

    on_robot(load(overrides=LIFTED), scenario)


def test_no_duty_follows_the_reset_of_a_driving_robots_board():
    """On the wire: the stop, the reset, and then nothing but stops until somebody commands again."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.25, 0.0, 1.0)
        written, write = bytearray(), robot.device.on_write

        def note(data: bytes) -> None:
            written.extend(data)
            write(data)

        robot.device.on_write = note
        await robot.client.reset_board()
        await asyncio.sleep(3.0)
        lines = bytes(written).split(b"\r")
        assert lines[0] == b"s 0 0"
        assert b"r" in lines
        assert set(lines) == {b"s 0 0", b"r", b""}

    on_robot(load(), scenario)


@pytest.mark.parametrize("wheel", sample([1, 0, 2, 3]))
@pytest.mark.parametrize("broken", sample([frozen, slipping]))
def test_a_wheel_that_disagrees_does_not_bend_the_odometry(broken: Callable[[int], Rewrite], wheel: int):
    """KHAN drives on for a second and a half: the wheel is named, and odometry stays within 2 cm and 3 degrees."""

    async def scenario(robot: SimulatedRobot) -> None:
        excluded: set[str] = set()
        await drive(robot, 0.3, 0.0, 1.0)
        rewire(robot, b"e", broken(wheel))
        for _ in range(10):
            await drive(robot, 0.3, 0.3, 0.15)
            excluded.update((await topic(robot, "wheels"))["excluded"])
        off_m, off_rad = await pose_error(robot)
        assert excluded == {FRONT_AND_REAR[wheel]}
        assert off_m < 0.02
        assert off_rad < math.radians(3.0)

    on_robot(knowing_its_size(load(packaged("khan"))), scenario)


@pytest.mark.parametrize("linear_m_s", [0.05, 0.3])
def test_a_dead_encoder_is_named_though_its_mate_stands_in(linear_m_s: float):
    """However gently it is driven, 1.75 s without a turn is a stall: disarmed, and the wheel is named."""

    async def scenario(robot: SimulatedRobot) -> None:
        rewire(robot, b"e", frozen(2))
        with pytest.raises(CallError) as refused:
            await drive(robot, linear_m_s, 0.0, 4.0)
        assert refused.value.kind == "disarmed"
        safety = await topic(robot, "safety")
        assert safety["fault"] == "wheel_stalled"
        assert safety["reason"].startswith("rear_left_wheel")

    on_robot(load(packaged("khan")), scenario)


@pytest.mark.slow
def test_healthy_wheels_agree():
    """Driving, turning on the spot, curving and reversing, nobody is left out at any time."""

    async def scenario(robot: SimulatedRobot) -> None:
        for linear_m_s, angular_rad_s in [(0.3, 0.0), (0.0, 1.5), (0.2, -1.0), (-0.3, 0.0), (0.02, 0.1)]:
            for _ in range(10):
                await drive(robot, linear_m_s, angular_rad_s, 0.1)
                assert (await topic(robot, "wheels"))["excluded"] == []

    on_robot(load(packaged("khan")), scenario)
