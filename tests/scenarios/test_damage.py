"""A cable that damages one byte in a hundred, both ways and without end: what comes of it in 36 s."""

import asyncio

import pytest

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.core.events import SafetyChanged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.scenarios.instruments import is_moving
from tests.scenarios.robots import settings_of
from tests.scenarios.wires import DISARMING, FASTEST_M_S, damage

SECONDS, PERIOD_S, LEG_S = 36.0, 0.05, 2.0
LEGS = ((0.2, 0.4), (0.1, -0.5), (-0.15, 0.3), (0.2, -0.4))


def slow(robot: str, share: str, seed: int) -> object:
    """A case for the full tier."""
    return pytest.param(robot, share, seed, marks=pytest.mark.slow)


async def drive(robot: SimulatedRobot) -> tuple[float, bool]:
    """Legs for 36 s, or until a second after the first refusal: the highest true speed, and whether it was refused."""
    loop, fastest_m_s = asyncio.get_running_loop(), 0.0
    began_s = loop.time()
    ends_s = began_s + SECONDS
    refused = False
    while loop.time() < ends_s:
        try:
            await robot.client.drive(*LEGS[int((loop.time() - began_s) / LEG_S) % len(LEGS)])
        except CallError:
            ends_s = ends_s if refused else min(ends_s, loop.time() + 1.0)
            refused = True
        for _ in range(5):
            await asyncio.sleep(PERIOD_S / 5)
            fastest_m_s = max(fastest_m_s, abs(robot.board.truth(0.0).twist.linear_m_s))
    return fastest_m_s, refused


async def driven_share(robot: SimulatedRobot) -> float:
    """Of a second, in how much a duty is in force. A flipped bit makes a zero an 8 at most, which turns no wheel."""
    driven = 0
    for _ in range(20):
        await asyncio.sleep(PERIOD_S)
        driven += any(robot.board.duty)
    return driven / 20


@pytest.mark.parametrize(
    ("robot_name", "share", "seed"),
    [
        ("chefbot", "flip", 6),
        ("khan", "drop", 1),
        slow("chefbot", "flip", 3),
        slow("chefbot", "drop", 4),
        slow("chefbot", "double", 5),
        slow("chefbot/duemilanove", "flip", 5),
        slow("chefbot/duemilanove", "drop", 5),
        slow("khan", "flip", 1),
        slow("khan", "drop", 3),
    ],
)
def test_steady_damage_both_ways_ends_in_a_stop_or_not_at_all(robot_name: str, share: str, seed: int):
    """Driven on as told, or disarmed by a fault that such damage is, and at rest; never much faster than asked."""

    async def scenario() -> None:
        async with simulated_robot(settings_of(robot_name, {"safety.guard.enabled": False})) as robot:
            await asyncio.sleep(1.0)
            changes = robot.daemon.bus.subscribe(SafetyChanged, size=1024)
            damage(robot, {f"{share}_share": 0.01}, seed)
            fastest_m_s, refused = await drive(robot)
            faults = [
                event.fault for event in (changes.take_event() for _ in range(len(changes))) if event.fault
            ]
            assert not faults or faults[0] in DISARMING[share]
            assert refused is bool(faults)
            assert fastest_m_s < FASTEST_M_S
            if refused:
                assert await driven_share(robot) < 0.5
                assert not is_moving(robot)

    run_virtual(scenario())
