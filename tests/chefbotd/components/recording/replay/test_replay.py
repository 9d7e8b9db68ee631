"""A recorded drive, replayed: the same events, bit for bit."""

import asyncio
import contextlib

import pytest

from chefbotd.client import MotionInterrupted
from chefbotd.core.events import FirmwareReported, SafetyChanged
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import recorded, replayed

KINDS = {
    "EncodersCounted",
    "WheelsDriven",
    "OdometryUpdated",
    "SafetyChanged",
    "LinkBytesWritten",
    "ControlChanged",
}


async def eventful(robot: SimulatedRobot) -> None:
    """An arc, a dead-man's timeout, new gains, a loop that stands still, faults, an e-stop, a restart, a lost link."""
    client = robot.client
    await client.set_client_name("pilot")
    await asyncio.sleep(1.0)
    await drive(robot, 0.21, 0.37, 1.1)
    await asyncio.sleep(1.2)
    await client.set_pid("left_wheel", kp=31.7)
    await drive(robot, -0.13, 0.55, 0.9)
    for pause_s in (0.6, 1.2):  # the robot goes on after the first, and is disarmed by the second
        asyncio.get_running_loop().stand_still(pause_s)  # type: ignore[attr-defined]
        await asyncio.sleep(0.1)
        if pause_s < 1.0:
            await drive(robot, -0.13, 0.55, 0.9)
    await asyncio.sleep(0.3)
    await client.arm()
    await drive(robot, 0.11, -0.2, 0.4)
    robot.daemon.driving.keeper.report_from_thread(Fault(FaultKind.INTERNAL_ERROR, "a thread says so"))
    await asyncio.sleep(0.3)
    await client.arm()
    await drive(robot, -0.13, 0.55, 0.9)
    await client.estop("a test")
    await asyncio.sleep(0.5)
    await client.arm()
    await client.reset_odometry(1.1, -0.3, 0.7)
    await drive(robot, 0.2, 0.0, 0.3)
    transport = robot.device.transport
    assert transport is not None
    transport.stall()
    await drive(robot, 0.35, 0.2, 0.2)
    robot.daemon.session.stop_from_thread()
    await drive(robot, 0.3, 0.1, 0.2)
    transport.drain()
    await drive(robot, 0.17, 0.0, 0.4)
    await client.reset_board()
    await asyncio.sleep(4.0)
    await client.arm()
    await drive(robot, 0.1, -0.8, 0.6)
    robot.device.unplug()
    await asyncio.sleep(1.3)
    robot.device.plug()
    await asyncio.sleep(3.0)
    await client.arm()
    await drive(robot, 0.3, 0.1, 0.7)


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Drive at odd moments, as a person does."""
    loop = asyncio.get_running_loop()
    until_s = loop.time() + seconds
    while loop.time() < until_s:
        with contextlib.suppress(MotionInterrupted):  # it was frozen together with the daemon
            await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.0731)


@pytest.mark.slow
def test_a_drive_is_replayed_bit_for_bit() -> None:
    """With a dead-man's timeout, an e-stop, gains, a restarted board and a pulled cable in it."""
    settings = load()
    events = recorded(eventful, settings)
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.exact
    assert outcome.from_start
    assert set(outcome.comparison.rows) >= KINDS
    faults = {each.fault for each in events if isinstance(each, SafetyChanged)}
    assert faults >= {"loop_blocked", "internal_error", "link_lost", "board_restarted"}
    assert {"SetpointWithdrawn", "DrainAnswered", "FaultTaken"} <= set(outcome.comparison.rows)
    assert outcome.comparison.rows["WheelsDriven"].recorded > 200


@pytest.mark.slow
def test_a_drive_with_our_own_firmware_is_replayed_bit_for_bit() -> None:
    """The same with a board that agrees on the checked mode, restarts, is lost, and agrees on it again."""
    settings = load(overrides={"sim.board.sketch": "chefbot", "encoders.counted_by": "firmware"})
    events = recorded(eventful, settings)
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.exact
    assert {"FirmwareReported", "DrainAnswered"} <= set(outcome.comparison.rows)
    modes = [each.mode for each in events if isinstance(each, FirmwareReported)]
    assert modes.count("checked") > 10


async def with_a_lost_link(robot: SimulatedRobot) -> None:
    """An arc, a pulled cable, an arc backwards, an e-stop."""
    await asyncio.sleep(1.2)
    await drive(robot, 0.21, 0.37, 1.1)
    robot.device.unplug()
    await asyncio.sleep(0.7)
    robot.device.plug()
    await asyncio.sleep(2.0)
    await robot.client.arm()
    await drive(robot, -0.1, -0.37, 0.8)
    await robot.client.estop("a test")
    await asyncio.sleep(0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "camera", "kinds"),
    [
        ("khan", False, {"AnalogueCounted", "WheelsDriven"}),
        ("chefbot_lidar", False, {"ScanMeasured", "LidarChanged"}),
        ("chefbot", True, {"ScanMeasured", "DepthCameraChanged"}),
    ],
)
def test_every_kind_of_robot_is_replayed_bit_for_bit(robot: str, camera: bool, kinds: set[str]) -> None:
    """Four wheels, a lidar, a depth camera."""
    told: dict[str, object] = {"depth_camera": [{"name": "eye", "rate_hz": 10.0}]} if camera else {}
    settings = load(packaged(robot), overrides=told)
    outcome = replayed(recorded(with_a_lost_link, settings), settings)
    assert outcome.first is None, str(outcome.first)
    assert outcome.problems == []
    assert kinds <= set(outcome.comparison.rows)
