"""The whole daemon with the wheel loop of our own firmware: the board finds the duties, the daemon keeps all else."""

import asyncio

import pytest

from chefbotd.settings import SettingsError, load
from chefbotd.testing.daemon import SimulatedRobot
from firmware_protocol.checked import unseal
from tests.scenarios.instruments import Stopwatch
from tests.scenarios.test_duties import TURN, Calibration
from tests.scenarios.test_firmware import DEAD_MAN_S, drive, firmware, on
from tests.scenarios.wires import frozen, rewire


def spoken(robot: SimulatedRobot) -> list[bytes]:
    """The words of the commands that the daemon has written last."""
    lines = [line for _, line in robot.daemon.session.lines.said]
    return [(unseal(line, b" ") or (line, 0))[0].split(b" ")[0] for line in lines]


@pytest.mark.parametrize(("linear_m_s", "angular_rad_s"), [(0.2, 0.0), (-0.15, 0.4), (0.1, -0.3)])
def test_the_robot_moves_as_it_is_told_by_speeds(linear_m_s: float, angular_rad_s: float):
    """`w` goes out in place of `s`, and after two seconds the true motion is what was asked for, within 5 %."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, linear_m_s, angular_rad_s, 2.0)
        assert spoken(robot)[-20:].count(b"w") > 15
        twist = robot.board.truth(0.0).twist
        assert twist.linear_m_s == pytest.approx(linear_m_s, rel=0.05, abs=0.004)
        assert twist.angular_rad_s == pytest.approx(angular_rad_s, rel=0.05, abs=0.03)
        assert (await robot.client.call("get_state"))["safety"]["fault"] is None

    on(scenario, link__wheel_loop=True)


def test_a_pulled_cable_and_an_estop_stop_the_loop():
    """The dead-man ends the wheel loop within 0.26 s; an e-stop does at once."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.1, 1.0)
        await robot.client.estop("smoke")
        await asyncio.sleep(0.02)
        assert robot.board.duty == (0, 0)
        await robot.client.arm()
        await drive(robot, 0.2, 0.1, 1.0)
        assert any(robot.board.duty)
        robot.device.unplug()
        watch = Stopwatch(robot)
        await asyncio.sleep(1.0)
        await watch.stop()
        assert 0.1 < watch.zero_s < DEAD_MAN_S

    on(scenario, link__wheel_loop=True)


def test_a_wheel_that_does_not_turn_is_a_fault_as_before():
    """An encoder's counts stand still: the controller here would give more and more duty, and the fault latches."""

    async def scenario(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        rewire(robot, b"e", frozen(0))
        for _ in range(40):
            await asyncio.sleep(0.05)
            if not (safety := (await robot.client.call("get_state"))["safety"])["armed"]:
                break
            await robot.client.drive(0.2, 0.0)
        assert safety["fault"] == "wheel_stalled"
        assert robot.board.duty == (0, 0)

    on(scenario, link__wheel_loop=True)


def test_it_is_off_unless_configured_and_set_up_anew_after_a_restart():
    """By default no `w` is ever written; with the key a board that restarted is told its parameters again."""

    async def off(robot: SimulatedRobot) -> None:
        await drive(robot, 0.2, 0.0, 1.0)
        assert b"w" not in spoken(robot)
        assert b"g" not in spoken(robot)

    async def again(robot: SimulatedRobot) -> None:
        await robot.client.reset_board()
        await asyncio.sleep(2.0)
        await robot.client.arm()
        await drive(robot, 0.2, 0.0, 1.0)
        assert spoken(robot)[-10:].count(b"w") > 7
        assert (await firmware(robot))["mode"] == "checked"

    on(off)
    on(again, link__wheel_loop=True)


def test_duties_of_a_calibration_reach_the_motors_past_the_boards_loop():
    """For a second the motors have the very duties, by `s`; before and after it the loop drives, by `w`."""

    async def scenario(robot: SimulatedRobot) -> None:
        calibration = Calibration(robot)
        for _ in range(2):
            await drive(robot, 0.1, 0.0, 1.0)
            assert spoken(robot)[-10:].count(b"w") > 7
            await asyncio.sleep(0.5)
            await calibration.drive(*TURN, seconds=1.0)
            assert robot.board.duty == TURN
            assert set(spoken(robot)[-20:]) <= {b"s", b"hello"}
            assert calibration.driven[-1].duty == TURN
            calibration.driver.let_go()
            await asyncio.sleep(0.5)
            assert robot.board.duty == (0, 0)

    on(scenario, link__wheel_loop=True)


def test_gains_that_are_changed_reach_the_board():
    """`set_pid` at a drive: kp 400 is 400 * 0.045 m * 256 = 4608 on the board, which drives on; undone, as before."""

    async def scenario(robot: SimulatedRobot) -> None:
        async def kp_on_board() -> bytes:
            await drive(robot, 0.2, 0.0, 0.6)
            lines = [line for _, line in robot.daemon.session.lines.said]
            bodies = [(unseal(line, b" ") or (line, 0))[0] for line in lines]
            assert bodies[-1].startswith(b"w")
            return [body for body in bodies if body.startswith(b"g 1 ")][-1]

        before = (await robot.client.get_pid())["left_wheel"].kp
        await robot.client.set_pid(kp=400.0)
        assert await kp_on_board() == b"g 1 4608"
        await robot.client.undo_pid()
        assert await kp_on_board() == b"g 1 %d" % round(before * 0.045 * 256)

    on(scenario, link__wheel_loop=True)


def test_a_motor_that_turns_against_its_encoder_is_refused():
    """The board's loop cannot know of it: the configuration names the key and the wheel."""
    wheels = [dict(wheel) for wheel in load().chassis.model_dump()["wheels"]]
    wheels[0]["motor_sign"] = -1
    with pytest.raises(SettingsError, match=r"wheel_loop needs a motor_sign.*left_wheel"):
        load(overrides={"link.wheel_loop": True, "chassis.wheels": wheels})
