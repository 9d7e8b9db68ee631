"""The robot's own calibration drives the motors by duties: what keeps it safe, on the simulated robot."""

import asyncio
from collections.abc import Awaitable, Callable
from itertools import count

import pytest

from chefbotd.client import CallError
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged, WheelsDriven
from chefbotd.core.geometry import WheelDuties
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.motion.drive import Drive
from chefbotd.safety.gate import CALIBRATION
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.wires import frozen, reversed_from_now, rewire, rewire_motor

STEP_S = 0.05
TURN = (-60, 60)
"""On the spot to the left, at about 0.07 m/s of each rim."""


class Calibration:
    """The driver, and what came of its duties."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot = robot
        self.driver = InnerDriver(robot.daemon.driving, robot.daemon.leases, LoopClock(), CALIBRATION)
        self.driven: list[WheelsDriven] = []
        self.changes: list[SafetyChanged] = []
        robot.daemon.bus.add_handler(self.driven.append, WheelsDriven)
        robot.daemon.bus.add_handler(self.changes.append, SafetyChanged)

    async def drive(self, *duty: int, seconds: float) -> None:
        """These duties, twenty times a second."""
        for _ in range(round(seconds / STEP_S)):
            self.driver.drive(WheelDuties(duty), asyncio.get_running_loop().time())
            await asyncio.sleep(STEP_S)

    async def drive_to_fault(self, *duty: int) -> tuple[str | None, float]:
        """These duties until a fault latches: its name, and after how many seconds; none within 4 s."""
        for steps in count(1):
            try:
                await self.drive(*duty, seconds=STEP_S)
            except Refused:
                return self.changes[-1].fault, steps * STEP_S
            if steps * STEP_S >= 4.0:
                return None, 4.0
        raise AssertionError

    @property
    def turning_rad_s(self) -> float:
        return self.robot.board.truth(asyncio.get_running_loop().time()).twist.angular_rad_s


def on_robot(scenario: Callable[[Calibration], Awaitable[None]], **overrides: object) -> None:
    """Run a scenario on the simulated ChefBot, armed."""

    async def run() -> None:
        async with simulated_robot(load(packaged("chefbot"), overrides=overrides)) as robot:
            await asyncio.sleep(1.0)
            await scenario(Calibration(robot))

    run_virtual(run())


def test_duties_reach_the_motors_as_they_are():
    """No ramp, no controller: the first duty on the wire is the one that was asked for, and the robot turns left."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(*TURN, seconds=1.0)
        moving = [event.duty for event in calibration.driven if any(event.duty)]
        assert set(moving) == {TURN}
        assert calibration.turning_rad_s == pytest.approx(0.44, rel=0.2)
        assert calibration.changes[-1].source == CALIBRATION

    on_robot(scenario)


def test_a_motor_that_is_wired_backwards_gets_the_duty_with_its_sign():
    """Forward is positive: with ``motor_sign = -1`` the wire has the negative duty."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(60, 60, seconds=0.2)
        assert calibration.driven[-1].duty == (-60, 60)

    wheels = [
        {"name": "left_wheel", "side": "left", "radius_m": 0.045, "motor_sign": -1},
        {"name": "right_wheel", "side": "right", "radius_m": 0.045},
    ]
    on_robot(scenario, **{"chassis.wheels": wheels})


def test_without_further_duties_the_dead_man_brakes():
    """0.5 s after the last one (safety.command_timeout_s) the wire has zero, and no earlier."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(*TURN, seconds=0.5)
        await asyncio.sleep(0.35)
        assert calibration.driven[-1].duty == TURN
        await asyncio.sleep(0.2)
        assert calibration.driven[-1].duty == (0, 0)
        assert calibration.changes[-1].source is None

    on_robot(scenario)


@pytest.mark.parametrize("way", ["stop", "estop"])
def test_a_stop_puts_zero_on_the_wire_and_holds_the_calibration(way: str):
    """In the same call; what the calibration asks for after it is refused."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(*TURN, seconds=0.5)
        await (calibration.robot.client.stop() if way == "stop" else calibration.robot.client.estop("cat"))
        assert not calibration.robot.daemon.driving.is_driving
        with pytest.raises(Refused):
            await calibration.drive(*TURN, seconds=STEP_S)
        assert not calibration.robot.daemon.driving.is_driving

    on_robot(scenario)


def test_a_person_takes_over_at_once():
    """``teleop`` is above the calibration: within a control step its setpoint drives, from zero."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(*TURN, seconds=0.5)
        await calibration.robot.client.drive(0.1, 0.0, "teleop")
        await asyncio.sleep(STEP_S)
        assert calibration.changes[-1].source == "teleop"
        assert calibration.driven[-1].duty not in (TURN, (0, 0))

    on_robot(scenario)


def test_no_client_drives_as_the_calibration_or_takes_it():
    """Nor does a client that tries delay the calibration after a stop."""

    async def scenario(calibration: Calibration) -> None:
        client = calibration.robot.client
        with pytest.raises(CallError) as refused:
            await client.drive(0.1, 0.0, CALIBRATION)
        assert refused.value.kind == "unknown_source"
        with pytest.raises(CallError) as refused:
            await client.take_control(CALIBRATION)
        assert refused.value.kind == "unknown_source"
        await client.stop()
        calibration.driver.begin(calibration.driver.stop_number, "this was asked for")
        await calibration.drive(*TURN, seconds=0.2)
        assert calibration.driven[-1].duty == TURN

    on_robot(scenario)


def test_no_other_driver_of_the_daemon_drives_by_duties():
    """Navigation's commands are velocities: a duty in its name is an error of the program, and moves nothing."""

    async def scenario(calibration: Calibration) -> None:
        driving = calibration.robot.daemon.driving
        with pytest.raises(ValueError, match="only the source 'calibration'"):
            driving.command("navigation", WheelDuties(TURN))
        assert not driving.is_driving

    on_robot(scenario)


def test_duties_towards_an_obstacle_stand():
    """The guard lets all of it pass or nothing: half of a duty would be another experiment. Turning stays allowed."""

    async def scenario(calibration: Calibration) -> None:
        await calibration.drive(120, 120, seconds=STEP_S * 2)
        assert calibration.driven[-1].duty == (0, 0)
        assert calibration.changes[-1].limited_by == "obstacle:front"
        await calibration.drive(*TURN, seconds=0.2)
        assert calibration.driven[-1].duty == TURN

    on_robot(scenario, **{"safety.guard.stop_distance_m": 3.0})


def test_limits_of_speed_bound_the_duties():
    """Full duty is 0.34 / 0.9 m/s free: 229 of 255 is left of it; half the turning allowed leaves half the duty."""
    settings = load(packaged("chefbot"), overrides={"limits.angular.max_left_rad_s": 0.34 / 0.9 / 0.15 / 2})
    drive = Drive(settings.drive, settings.chassis, settings.limits, tuple(settings.gains().values()))
    assert drive.wheel_duties(WheelDuties((255, 255))).duty == (229, 229)
    assert drive.wheel_duties(WheelDuties((-255, 255))).duty == (-127, 127)
    motion = drive.wheel_duties(WheelDuties((51, 0)))
    assert motion.duty == (51, 0)
    assert motion.rad_s == pytest.approx((0.34 / 0.9 / 5 / 0.045, 0.0))
    with pytest.raises(ValueError, match="expected a duty for each of left_wheel, right_wheel, got"):
        drive.wheel_duties(WheelDuties((1, 2, 3)))


def test_intended_steps_are_no_fault():
    """Half a second each up and down, forward and back, from less than friction to the most, at both ends."""

    async def scenario(calibration: Calibration) -> None:
        for duty in (15, -15, 40, -40, 200, -200, 229, 30, -229, 25, 120, 0, 80, -20):
            await calibration.drive(-duty, duty, seconds=0.5)
        await asyncio.sleep(1.0)
        assert {event.fault for event in calibration.changes} == {None}

    on_robot(scenario)


@pytest.mark.parametrize("phase_s", [0.0, 0.01, 0.02, 0.03, 0.04])
def test_a_wheel_that_does_not_turn_is_found(phase_s: float):
    """Its encoder is dead: stalled after 1.75 s (safety.wheels.stalled_s) with the duty in force for certain.

    A duty waits up to 0.05 s until a cycle of the board begins, and 0.02 s for the line. That cycle reads it and lasts
    0.05 s until the duty is in force, and the readings are 0.05 s apart: 1.92 s after the first duty at the latest.
    """

    async def scenario(calibration: Calibration) -> None:
        await asyncio.sleep(phase_s)
        rewire(calibration.robot, b"e", frozen(0))
        began_s = asyncio.get_running_loop().time()
        fault, seconds = await calibration.drive_to_fault(*TURN)
        assert fault == "wheel_stalled"
        assert 1.75 <= calibration.changes[-1].stamp_s - began_s <= 1.92
        assert seconds <= 2.0  # counted in whole steps of the driver, and the one that is refused

    on_robot(scenario)


@pytest.mark.parametrize("what", ["motor", "encoder"])
def test_a_wheel_that_turns_the_other_way_is_found(what: str):
    """After a radian (safety.wheels.reversed_rad), at 1.4 rad/s; a step of less passes, so that it can be measured."""

    async def scenario(calibration: Calibration) -> None:
        if what == "motor":
            rewire_motor(calibration.robot, 1)
        else:
            rewire(calibration.robot, b"e", reversed_from_now(1))
        fault, seconds = await calibration.drive_to_fault(*TURN)
        assert fault == "wheel_reversed"
        assert 0.6 <= seconds <= 1.1

    on_robot(scenario)


def test_a_wrong_full_scale_is_found():
    """Duties for 1023 on a board of 255: the wheels are four times as fast as these duties may make them."""

    async def scenario(calibration: Calibration) -> None:
        fault, seconds = await calibration.drive_to_fault(-160, 160)
        assert fault == "overspeed"
        assert seconds <= 0.8

    on_robot(scenario, **{"drive.max_duty": 1023})
