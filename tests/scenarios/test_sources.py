"""Which source moves the simulated robot, and for how long after its last word: both robots, with their own numbers."""

import asyncio
from collections.abc import Awaitable, Callable
from itertools import pairwise

import pytest

from chefbotd.cli.drive.timed_drive import drive_for
from chefbotd.client import Client
from chefbotd.clock import run_virtual
from chefbotd.components.tuning.cli.excitation import Exciter, Wave
from chefbotd.core.events import SafetyChanged, WheelsDriven
from chefbotd.core.geometry import Twist2D
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

TICK_S = 0.025
"""A board cycle or a watch period, and a bit: the gate is looked at no more rarely."""

Scenario = Callable[[SimulatedRobot], Awaitable[None]]


def on_robot(settings: Settings, scenario: Scenario) -> None:
    """Run a scenario with the board up and the encoders coming in."""

    async def run() -> None:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


def pairs() -> list[tuple[str, str, str]]:
    """Each robot's sources but the lowest, each with the one below it."""
    found = []
    for robot in ("chefbot", "khan"):
        safety = load(packaged(robot)).safety
        sources = safety.sources
        order = sorted(safety.offered, key=lambda name: -sources[name].priority)
        found += [(robot, higher, lower) for higher, lower in pairwise(order)]
    return found


@pytest.mark.parametrize(("robot_name", "higher", "lower"), pairs())
def test_a_silent_source_keeps_lower_ones_out_until_its_time_out(robot_name: str, higher: str, lower: str):
    """One message by the higher source, the lower at 20 Hz: the dead-man, if it is sooner, the time-out, then on."""
    settings = load(packaged(robot_name))
    moves_s, keeps_s = settings.safety.command_timeout_s, settings.safety.sources[higher].timeout_s

    async def scenario(robot: SimulatedRobot) -> None:
        loop, changes = asyncio.get_running_loop(), robot.daemon.bus.subscribe(SafetyChanged, size=100)
        await robot.client.drive(0.2, 0.0, higher)
        spoke_s = loop.time()
        while loop.time() < spoke_s + keeps_s + 0.3:
            await robot.client.drive(0.1, 0.0, lower)
            await asyncio.sleep(0.05)
        told = [changes.take_event() for _ in range(len(changes))]
        steps = [(e.source, e.limited_by) for e in told if e.source is not None]
        taken_over_s = next(e.stamp_s for e in told if e.source == lower) - spoke_s
        assert keeps_s <= taken_over_s <= keeps_s + TICK_S
        if keeps_s < moves_s:
            assert steps == [(higher, None), (lower, None)]
            return
        assert steps == [(higher, None), (higher, "dead_man"), (lower, None)]
        stopped_s = next(e.stamp_s for e in told if e.limited_by == "dead_man") - spoke_s
        assert moves_s <= stopped_s <= moves_s + TICK_S

    on_robot(settings, scenario)


def test_a_handover_in_mid_motion_goes_through_zero_within_the_limits():
    """ChefBot's safety backs up and falls silent for 0.2 s: navigation turns the robot round at 1 m/s2, no faster."""

    async def scenario(robot: SimulatedRobot) -> None:
        loop, driven = asyncio.get_running_loop(), robot.daemon.bus.subscribe(WheelsDriven, size=1000)
        began_s = loop.time()
        while loop.time() < began_s + 1.5:
            if loop.time() < began_s + 0.5:
                await robot.client.drive(-0.2, 0.0, "safety")
            await robot.client.drive(0.2, 0.0, "navigation")
            await asyncio.sleep(0.05)
        events = [driven.take_event() for _ in range(len(driven))]
        setpoints = [(e.stamp_s, e.target_rad_s[0] * 0.045) for e in events if e.stamp_s > began_s + 0.4]
        assert (setpoints[0][1], setpoints[-1][1]) == (pytest.approx(-0.2), pytest.approx(0.2))
        for (before_s, before_m_s), (after_s, after_m_s) in pairwise(setpoints):
            assert abs(after_m_s - before_m_s) <= 1.0 * (after_s - before_s) + 0.005

    on_robot(load(packaged("chefbot")), scenario)


@pytest.mark.parametrize("source", ["joystick", "marker", "move_base", "external"])
def test_one_message_moves_khan_for_its_published_command_time_out(source: str):
    """After 0.25 s its wheels' targets fall from 0.2 m/s at 3 m/s2: at zero 0.067 s later, a tick more or less."""

    async def scenario(robot: SimulatedRobot) -> None:
        driven = robot.daemon.bus.subscribe(WheelsDriven, size=1000)
        await robot.client.drive(0.2, 0.0, source)
        spoke_s = asyncio.get_running_loop().time()
        await asyncio.sleep(1.0)
        events = [driven.take_event() for _ in range(len(driven))]
        targets = [(e.stamp_s - spoke_s, e.target_rad_s[0]) for e in events if e.stamp_s > spoke_s]
        full_rad_s = 0.2 / 0.03
        assert max(t for _, t in targets) == pytest.approx(full_rad_s)
        last_full_s = max(at_s for at_s, t in targets if t == pytest.approx(full_rad_s))
        at_rest_s = next(at_s for at_s, t in targets if at_s > last_full_s and t == 0.0)
        assert 0.25 - TICK_S <= last_full_s <= 0.25 + TICK_S
        assert 0.25 + 0.2 / 3.0 - TICK_S <= at_rest_s <= 0.25 + 0.2 / 3.0 + 2 * TICK_S

    on_robot(load(packaged("khan")), scenario)


async def timed_drive(robot: Client) -> None:
    """``chefbotctl drive 0.15 0.2 --for 1``."""
    await drive_for(robot, Twist2D(0.15, 0.2), 1.0, lambda gone_s: None)


async def wave(robot: Client) -> None:
    """A second of the wave of ``pid tune``, and leaving."""
    exciter = Exciter(robot, Wave(0.1, 1.5), lambda refusal: None)
    exciter.start()
    running = asyncio.create_task(exciter.run())
    await asyncio.sleep(1.0)
    exciter.end()
    await asyncio.sleep(0.1)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


@pytest.mark.parametrize("program", [timed_drive, wave])
def test_a_drive_that_ends_holds_nobody(program: Callable[[Client], Awaitable[None]]):
    """Navigation, overruled meanwhile, is refused nothing, and drives again as soon as the program has ended."""

    async def scenario(robot: SimulatedRobot) -> None:
        host, port = await robot.daemon.server.address()
        async with Client.connect(host, port, name="navigation") as navigation:

            async def navigate() -> None:
                while True:
                    await navigation.drive(-0.1, 0.1, "navigation")  # raises what it is refused for
                    await asyncio.sleep(0.05)

            navigating = asyncio.create_task(navigate())
            await program(robot.client)
            await asyncio.sleep(0.6)
            assert not navigating.done()
            assert (await robot.client.get_state()).safety.source == "navigation"
            assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(-0.1, rel=0.1)
            navigating.cancel()
            await asyncio.gather(navigating, return_exceptions=True)

    on_robot(load(packaged("chefbot"), overrides={"safety.guard.enabled": False}), scenario)
