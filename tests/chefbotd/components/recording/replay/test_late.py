"""Recordings that began while the robot drove: they have the state of every part, and are replayed from it."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from chefbotd.client import GoalCancelled
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.events.inputs import RequestHandled, StateRecorded
from chefbotd.process.service import DaemonTarget
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.worker import worker_in_process
from tests.chefbotd.components.recording.replay.recordings import LateRecorder, recorded_late, replayed
from tests.chefbotd.components.recording.replay.test_replay import drive

LateScript = Callable[[SimulatedRobot, LateRecorder], Awaitable[None]]

START = {"sim.world.start_x_m": 2.45, "sim.world.start_y_m": 2.6, "sim.world.start_heading_rad": 2.1}


async def short(robot: SimulatedRobot, recorder: LateRecorder) -> None:
    """An arc, in the middle of which recording begins; other gains before it."""
    await robot.client.set_client_name("pilot")
    await asyncio.sleep(0.9)
    await robot.client.set_pid("all", kp=31.7)
    await drive(robot, 0.21, 0.37, 0.63)
    recorder.begin()
    await drive(robot, 0.17, 0.31, 0.3)
    await asyncio.sleep(0.7)


def test_a_recording_that_began_in_mid_drive_is_replayed_bit_for_bit() -> None:
    """Gains, ramps, odometry, the lease and the timers that ran are in the state at its beginning."""
    settings = load()
    events = recorded_late(short, settings)
    assert isinstance(events[0], StateRecorded)
    outcome = replayed(events, settings)
    assert outcome.left_out == ()
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert (outcome.from_start, outcome.from_state) == (False, True)
    assert outcome.comparison.counts["WheelsDriven"] > 15
    assert outcome.comparison.counts["SafetyChanged"] > 0  # the dead-man


async def steady(robot: SimulatedRobot, recorder: LateRecorder) -> None:
    """Repeats one command until it is followed as it is, and on; recording begins in the middle."""
    await asyncio.sleep(0.9)
    await drive(robot, 0.21, 0.37, 1.3)
    recorder.begin()
    await drive(robot, 0.21, 0.37, 0.5)
    await robot.client.stop()
    await asyncio.sleep(0.7)


async def steady_as_earlier(robot: SimulatedRobot, recorder: LateRecorder) -> None:
    """The same of a daemon that knows no renewal, as those of earlier versions."""
    robot.daemon.rpc.exchange_methods(lambda method: replace(method, renew=None))
    await steady(robot, recorder)


@pytest.mark.parametrize("script", [steady, steady_as_earlier])
def test_commands_that_were_renewed_are_renewed_in_a_replay_and_others_carried_out(
    script: LateScript,
) -> None:
    """The recording says which; that of an earlier version says so of none."""
    settings = load()
    events = recorded_late(script, settings)
    renewals = [
        event.renews for event in events if isinstance(event, RequestHandled) and event.method == "drive"
    ]
    assert any(renewals) is (script is steady)
    assert len(renewals) > 5
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.comparison.counts["WheelsDriven"] > 20


def test_limits_that_wait_for_the_robot_to_stand_are_in_the_state() -> None:
    """They were read anew in mid-drive, before the recording began; it stands after that, and obeys them."""

    async def script(robot: SimulatedRobot, recorder: LateRecorder) -> None:
        await asyncio.sleep(0.9)
        await drive(robot, 0.21, 0.37, 0.63)
        changed = {"limits.linear.acceleration_m_s2": 0.13, "limits.linear.deceleration_m_s2": 0.5}
        slower = load(overrides=changed).limits
        assert not DaemonTarget(robot.daemon).exchange_limits(slower)
        recorder.begin()
        await robot.client.stop()
        await asyncio.sleep(1.9)
        await drive(robot, 0.17, 0.31, 0.7)

    settings = load()
    outcome = replayed(recorded_late(script, settings), settings)
    assert outcome.first is None, str(outcome.first)
    assert outcome.comparison.counts["WheelsDriven"] > 30


def test_without_its_state_it_is_not_the_same() -> None:
    """The test above would see it if the state were not put back."""
    settings = load()
    events = recorded_late(short, settings)
    emptied = replace(events[0], parts={})
    assert replayed([emptied, *events[1:]], settings).first is not None


def test_a_replay_with_another_configuration_keeps_its_gains_from_a_state() -> None:
    """A client had set kp to 31.7: a configuration that says so drives the same, and the recorded one does not."""
    settings = load()
    events = recorded_late(short, settings)
    same = replayed(events, load(overrides={"pid.kp_duty_per_m_s": 31.7}), own_timers=True)
    assert same.first is None, str(same.first)
    other = replayed(events, settings, own_timers=True)
    assert other.first is not None
    assert other.comparison.rows["WheelsDriven"].differing > 10
    assert not other.comparison.rows["OdometryUpdated"].differing


def test_what_was_under_way_at_the_beginning_is_told_until_a_whole_state_comes() -> None:
    """A state that lacks something is said to; from the next whole one on everything is the same."""

    async def script(robot: SimulatedRobot, recorder: LateRecorder) -> None:
        await short(robot, recorder)
        robot.daemon.bus.publish(robot.daemon.state.record())
        await drive(robot, -0.1, 0.2, 0.4)

    settings = load()
    events = recorded_late(script, settings)
    states = [index for index, event in enumerate(events) if isinstance(event, StateRecorded)]
    lacking = replace(events[0], parts={}, left_out=("request 7 (finish_mapping) is under way",))
    outcome = replayed([lacking, *events[1:]], settings)
    assert outcome.left_out == ("request 7 (finish_mapping) is under way",)
    assert outcome.first is not None
    assert outcome.same_since_s is not None
    assert outcome.first.stamp_s < outcome.same_since_s <= events[states[1]].stamp_s


async def eventful(robot: SimulatedRobot, recorder: LateRecorder) -> None:
    """Recording begins in mid-drive; then a dead-man's timeout, an e-stop, gains, a lost link."""
    client = robot.client
    await client.set_client_name("pilot")
    await asyncio.sleep(1.2)
    await client.set_pid("all", kp=31.7)
    await drive(robot, 0.21, 0.37, 1.13)
    recorder.begin()
    await drive(robot, 0.17, 0.31, 0.9)
    await asyncio.sleep(0.9)
    await drive(robot, -0.13, 0.55, 0.7)
    await client.estop("a test")
    await asyncio.sleep(0.4)
    await client.arm()
    await client.undo_pid()
    await drive(robot, 0.11, -0.2, 0.6)
    await client.reset_odometry(1.1, -0.3, 0.7)
    await drive(robot, 0.2, 0.1, 0.5)
    robot.device.unplug()
    await asyncio.sleep(0.7)
    robot.device.plug()
    await asyncio.sleep(2.0)
    await client.arm()
    await drive(robot, 0.3, 0.1, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["chefbot", "khan", "chefbot_lidar"])
def test_every_robot_is_replayed_from_the_middle_of_a_drive(robot: str) -> None:
    """Two wheels, four, and a lidar."""
    settings = load(packaged(robot))
    events = recorded_late(eventful, settings)
    outcome = replayed(events, settings)
    assert outcome.left_out == ()
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.comparison.counts["WheelsDriven"] > 60


@pytest.mark.slow
def test_a_recording_that_began_on_the_way_to_a_goal_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    """The client waits for the goal's end when recording begins, and gives it up later: that ends the goal."""
    save(MapStore(tmp_path, 3), "flat", FLAT.grid())

    async def script(robot: SimulatedRobot, recorder: LateRecorder) -> None:
        client = robot.client
        await asyncio.sleep(1.5)
        await client.load_map("flat")
        async with asyncio.timeout(15.0), client.subscribe("localization") as events:
            async for event in events:
                if event.data.state == "localized":
                    break
        goal = asyncio.create_task(client.navigate_to(x_m=2.6, y_m=4.0, heading_rad=0.4))
        await asyncio.sleep(2.1)
        recorder.begin()
        await asyncio.sleep(1.7)
        goal.cancel()
        with contextlib.suppress(asyncio.CancelledError, GoalCancelled):
            await goal
        await asyncio.sleep(1.0)
        await client.navigate_to(x_m=2.5, y_m=3.2)
        await asyncio.sleep(0.3)

    settings = load(packaged("chefbot_lidar"), overrides={"maps.folder": str(tmp_path), **START})
    events: list[Any] = recorded_late(script, settings, worker_in_process)
    outcome = replayed(events, settings)
    assert outcome.left_out == ()
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    counted = outcome.comparison.counts
    assert counted["NavigationChanged"] > 3
    assert counted["MapPoseUpdated"] > 10
