"""Driving to goals in the simulated flat: how goals begin and end, and who may interrupt them."""

import asyncio
import math

import pytest

from chefbotd.client import CallError, GoalCancelled, GoalFault, GoalUnreachable
from tests.scenarios.on_the_way import GOAL, Drive, drives_in_flat

pytestmark = pytest.mark.slow


@drives_in_flat()
async def test_a_leg_ends_where_it_was_asked_for(drive: Drive) -> None:
    """Through a door: within 4 cm and 3 degrees by the truth, and told before with length and time."""
    plan = await drive.client.plan_to(**GOAL)
    assert plan.possible
    assert plan.length_m == pytest.approx(math.dist((2.45, 2.6), (2.6, 4.0)), rel=0.15)
    assert drive.speed_m_s < 0.005
    assert "reached" in await drive.begin()
    off_m, off_rad = drive.off()
    assert off_m < 0.04
    assert off_rad < math.radians(3)
    states = [event.state for event in drive.told]
    assert states[-1] == "reached"
    assert "driving" in states
    assert "navigation" in {event.source for event in drive.safety}


@drives_in_flat()
async def test_a_goal_in_a_wall_is_unreachable_and_nothing_moves(drive: Drive) -> None:
    """The wall between living room and hall; the nearest free place is offered, not driven to."""
    with pytest.raises(GoalUnreachable, match="the nearest place that can be reached"):
        await drive.begin(x_m=3.2, y_m=3.35)
    assert drive.off()[0] > 1.2


@drives_in_flat(overrides={"safety.guard.stop_distance_m": 0.18})
async def test_goals_beside_a_wall_are_reached_where_the_guard_stops_the_robot_farther_off(
    drive: Drive,
) -> None:
    """0.11 m from the hall's wall, straight ahead, where the guard stops it at 0.15 m: three headings."""
    x_m, y_m = 2.0, 4.6 - 0.18 - 0.11
    for heading_rad in (math.pi / 2 + 1.1, math.pi / 2, 0.3):
        assert "reached" in await drive.begin(x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        pose = drive.truth.world_from_base
        assert math.dist((pose.x_m, pose.y_m), (x_m, y_m)) < 0.04
        assert abs(math.remainder(pose.heading_rad - heading_rad, math.tau)) < math.radians(3)
    assert "obstacle:front" in {event.limited_by for event in drive.safety}


@drives_in_flat()
async def test_a_killed_worker_leaves_the_robot_standing_and_the_next_one_goes_on(drive: Drive) -> None:
    """At rest within the dead-man and the ramp; told why; then the goal is reached all the same."""
    leg = drive.begin()
    await drive.until_driving()
    drive.children[-1].kill()
    await asyncio.sleep(0.5 + 0.5)
    assert drive.speed_m_s < 0.005
    paused = next(event for event in drive.told if event.state == "paused")
    assert "waits until its worker is back: it was killed" in paused.reason
    assert "reached" in await leg
    assert len(drive.children) == 2


@drives_in_flat()
async def test_teleop_takes_over_at_once_and_the_goal_goes_on(drive: Drive) -> None:
    """A person backs the robot up for a second: navigation is paused meanwhile, and reaches its goal then."""
    leg = drive.begin()
    await drive.until_driving()
    before = len(drive.safety)
    for _ in range(10):
        await drive.client.drive(-0.05, 0.0, "teleop")
        await asyncio.sleep(0.1)
        assert drive.safety[-1].source == "teleop"
    assert drive.safety[before].source == "teleop"
    assert drive.told[-1].state == "paused"
    assert "reached" in await leg


@pytest.mark.parametrize("paused", [False, True])
@drives_in_flat()
async def test_a_stop_cancels_the_goal(drive: Drive, paused: bool) -> None:
    """At rest, and it says by whom. After 2 s of a pause as well: ``resume`` does not make it go on then."""
    leg = drive.begin()
    await drive.until_driving()
    if paused:
        await drive.client.pause_navigation()
        await asyncio.sleep(2.0)
    await drive.client.stop()
    with pytest.raises(GoalCancelled, match="navigation was stopped by"):
        await leg
    if paused:
        await drive.client.resume_navigation()
    await asyncio.sleep(2.0)
    assert drive.speed_m_s < 0.005


@drives_in_flat()
async def test_an_estop_ends_the_goal_as_a_fault(drive: Drive) -> None:
    """And a goal is refused until the robot is armed again."""
    leg = drive.begin()
    await drive.until_driving()
    await drive.client.estop("a child")
    with pytest.raises(GoalFault, match="a child"):
        await leg
    with pytest.raises(CallError, match="arm the robot first"):
        await drive.begin()
    await drive.client.arm()
    assert "reached" in await drive.begin()


@drives_in_flat()
async def test_giving_up_the_request_stands_the_robot(drive: Drive) -> None:
    """Ctrl-C in a program that waits: at rest within half a second, and the goal is cancelled."""
    leg = drive.begin()
    await drive.until_driving()
    leg.cancel()
    await asyncio.sleep(0.6)
    assert drive.speed_m_s < 0.01
    assert drive.told[-1].state == "cancelled"


@drives_in_flat()
async def test_a_goal_that_is_sent_while_a_person_drives_begins_when_he_has_let_go(drive: Drive) -> None:
    """He turns the robot for 8 s, longer than it may fail to come on: the goal is paused, and then reached."""
    await drive.client.drive(0.0, 0.3, "teleop")
    leg = drive.begin()
    for _ in range(80):
        await drive.client.drive(0.0, 0.3, "teleop")
        await asyncio.sleep(0.1)
    assert drive.told[-1].state == "paused"
    assert drive.told[-1].reason == "paused, because teleop has control"
    assert "reached" in await leg
    assert not any(event.state == "recovering" for event in drive.told)
