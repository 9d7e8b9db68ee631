"""A robot at rest is looked at more seldom, and tells each fault at the time at which it always did."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import cast

import pytest

from chefbotd.clock import LoopClock
from chefbotd.core.events import (
    BatteryLevelStatus,
    BatteryMeasured,
    BoardRestarted,
    EncodersCounted,
    LinkClosed,
    LinkOpened,
    RangeMeasured,
    RangeStatus,
    SafetyChanged,
)
from chefbotd.core.geometry import Twist2D
from chefbotd.driving import watch_timer
from chefbotd.driving.service import DriveService
from chefbotd.safety.gate import Mode
from tests.chefbotd.driving.rig import AHEAD, Rig, on_rig

Scenario = Callable[[Rig], Awaitable[None]]
Told = list[tuple[float, str, str | None, str | None, str | None]]

OBLIQUE_S = 0.0473
"""The board's cycle: no multiple of the 20 ms in which the robot is looked at."""


def count(rig: Rig, counts: tuple[int, int]) -> None:
    """An encoder frame."""
    now_s = rig.clock.now_s()
    rig.bus.publish(EncodersCounted(now_s, now_s, now_s, counts))


async def at_rest(rig: Rig, seconds: float = 1.6) -> None:
    """Encoder frames that show no motion, and nobody asks for anything."""
    for _ in range(round(seconds / OBLIQUE_S)):
        await asyncio.sleep(OBLIQUE_S)
        count(rig, (7, -3))


async def silent(rig: Rig) -> None:
    """The encoders fall silent, and somebody drives only then."""
    await at_rest(rig)
    await asyncio.sleep(0.433)
    rig.service.command("teleop", AHEAD)
    await asyncio.sleep(2.9)


async def silent_while_driven(rig: Rig) -> None:
    """A command moves the robot out of its rest; then nothing is heard for longer than may be."""
    await at_rest(rig)
    rig.service.command("teleop", Twist2D(0.13, -0.4))
    await asyncio.sleep(3.1)


async def dead_man(rig: Rig) -> None:
    """One command, and no other one."""
    await at_rest(rig)
    await asyncio.sleep(0.0071)
    rig.service.command("teleop", Twist2D(-0.11, 0.3))
    await at_rest(rig, 1.3)


async def critical_battery(rig: Rig) -> None:
    """The battery is empty for long, told between two encoder frames."""
    await at_rest(rig)
    for _ in range(80):
        await asyncio.sleep(OBLIQUE_S)
        count(rig, (7, -3))
        await asyncio.sleep(0.0311)
        now_s = rig.clock.now_s()
        rig.bus.publish(
            BatteryMeasured(11.1, 0.0, BatteryLevelStatus.CRITICAL, stamp_s=now_s, arrival_s=now_s)
        )
    await asyncio.sleep(0.3)


async def broken_reading(rig: Rig) -> None:
    """A range that breaks the handler of ranges."""
    await at_rest(rig)
    await asyncio.sleep(0.0449)
    now_s, unhashable = rig.clock.now_s(), cast(RangeStatus, [])
    rig.bus.publish(RangeMeasured(now_s, now_s, "front", unhashable, None, 0.02, 4.0, 0.5))
    await asyncio.sleep(0.4)


async def lost_link(rig: Rig) -> None:
    """The cable is pulled and comes back; the board restarts."""
    await at_rest(rig)
    await asyncio.sleep(0.0533)
    rig.bus.publish(LinkClosed(rig.clock.now_s(), "fake", "pulled"))
    await asyncio.sleep(0.7)
    rig.bus.publish(LinkOpened(rig.clock.now_s(), "fake"))
    rig.service.arm()
    await at_rest(rig)
    rig.bus.publish(BoardRestarted(rig.clock.now_s(), "it said so"))
    await at_rest(rig, 0.4)


async def running_away(rig: Rig) -> None:
    """The wheels turn three times as fast as they are asked to."""
    await at_rest(rig)
    for step in range(20):
        await asyncio.sleep(OBLIQUE_S)
        if rig.service.keeper.gate.mode is Mode.ARMED:
            rig.service.command("teleop", AHEAD)
        await asyncio.sleep(0.0011)
        count(rig, (7 + 90 * step, -3 + 95 * step))


SCENARIOS = (silent, silent_while_driven, dead_man, critical_battery, broken_reading, lost_link, running_away)


def told(scenario: Scenario) -> Told:
    """What was said of safety, and when."""
    events: list[SafetyChanged] = []

    async def run(rig: Rig) -> None:
        rig.bus.add_handler(events.append, SafetyChanged)
        await scenario(rig)

    on_rig(run)
    return [(e.stamp_s, e.mode, e.source, e.fault, e.limited_by) for e in events]


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda each: each.__name__)
def test_a_fault_is_told_when_a_robot_that_never_rests_tells_it(
    scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same words at the same time as with a look every 20 ms, whatever happens to a robot at rest."""
    rested = told(scenario)
    monkeypatch.setattr(watch_timer, "REST_AFTER_S", float("inf"))
    watched = told(scenario)
    assert [each[1:] for each in rested] == [each[1:] for each in watched]
    assert [each[0] for each in rested] == pytest.approx([each[0] for each in watched], abs=1e-6)
    assert rested


def looks(monkeypatch: pytest.MonkeyPatch, scenario: Scenario) -> list[float]:
    """When the drive watch has fired."""
    fired: list[float] = []
    watch = DriveService._watch

    def noted(self: DriveService) -> None:
        fired.append(LoopClock().now_s())
        watch(self)

    monkeypatch.setattr(DriveService, "_watch", noted)
    on_rig(scenario)
    return fired


def test_a_robot_at_rest_is_not_looked_at_between_its_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames every 47 ms: two looks between each pair in the first second, then none, and two again once driven."""
    marks: list[float] = []

    async def scenario(rig: Rig) -> None:
        await at_rest(rig, 1.3)
        marks.append(rig.clock.now_s())
        await at_rest(rig, 2.0)
        marks.append(rig.clock.now_s())
        rig.service.command("teleop", AHEAD)
        await at_rest(rig, 0.4)

    fired = looks(monkeypatch, scenario)
    calm, driven = marks
    assert len([each for each in fired if each < calm - 0.3]) >= 30
    assert [each for each in fired if calm < each < driven] == []
    assert len([each for each in fired if each > driven]) >= 14


def test_a_robot_at_rest_whose_encoders_are_silent_is_looked_at_twice_in_the_patience(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The watchdog lets the loop stand for 0.25 s: it acts every 0.12 s, six times 20 ms, and writes a stop."""
    stops: list[float] = []

    async def scenario(rig: Rig) -> None:
        await at_rest(rig)
        began_s, count = rig.elapsed_s, len(rig.written)
        await asyncio.sleep(1.01)
        stops.extend(at_s - began_s for at_s, duty in rig.written[count:] if duty == (0, 0))

    looks(monkeypatch, scenario)
    assert stops == pytest.approx([0.12 * count for count in range(1, 9)], abs=1e-6)
