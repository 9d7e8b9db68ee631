"""A healthy robot is never accused, however it is driven, loaded or braked, and whatever its board runs."""

import asyncio
import contextlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.core.events import SafetyChanged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import IS_FULL
from tests.scenarios.robots import settings_of

PERIOD_S = 0.05
ACCUSED = ("overspeed", "board_unresponsive", "echo_mismatch")
EXAMPLES = 15 if IS_FULL else 4
"""Of six legs at most, each."""

LINEAR_M_S, ANGULAR_RAD_S = 0.45, 2.6
"""Beyond what either robot may do: the limits are part of what is tried."""

MASSES_KG = (0.0, 3.0, 6.0, 9.0)
"""Lifted from the ground, light, as both are simulated unless told otherwise, and with half of that on top."""

SIDE_PX, PX_M = 200, 0.2

Leg = tuple[float, float, float, str]

legs = st.lists(
    st.tuples(
        st.floats(-LINEAR_M_S, LINEAR_M_S),
        st.floats(-ANGULAR_RAD_S, ANGULAR_RAD_S),
        st.sampled_from([0.1, 0.25, 0.6, 1.5]),
        st.sampled_from(["go on", "turn round", "stop", "fall silent"]),
    ),
    min_size=2,
    max_size=6,
)


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of 40 m by 40 m with nothing in it, the robot in its middle: a wheel that a wall holds is no healthy one."""
    folder, wall = tmp_path_factory.mktemp("hall"), bytes(SIDE_PX)
    row = b"\0" + (SIDE_PX - 2) * b"\xfe" + b"\0"
    image = b"P5 %d %d 255\n" % (SIDE_PX, SIDE_PX) + wall + (SIDE_PX - 2) * row + wall
    (folder / "hall.pgm").write_bytes(image)
    middle_m = -SIDE_PX * PX_M / 2
    text = f"image: hall.pgm\nresolution: {PX_M}\norigin: [{middle_m}, {middle_m}, 0.0]\nnegate: 0\n"
    (folder / "hall.yaml").write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return folder / "hall.yaml"


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a command at 20 Hz."""
    for _ in range(round(seconds / PERIOD_S)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(PERIOD_S)


async def go(robot: SimulatedRobot, leg: Leg) -> None:
    """A leg: a command, and how it ends."""
    linear_m_s, angular_rad_s, seconds, end = leg
    await drive(robot, linear_m_s, angular_rad_s, seconds)
    if end == "turn round":
        await drive(robot, -linear_m_s, -angular_rad_s, 0.5)
    elif end == "stop":
        await robot.client.stop()
        await asyncio.sleep(0.3)
    elif end == "fall silent":
        await asyncio.sleep(1.2)


def faults_of(hall: Path, robot_name: str, mass_kg: float, driven: list[Leg]) -> list[tuple[str, str]]:
    """What was found on a robot whose every part works."""
    overrides = {"safety.guard.enabled": False, "sim.body.mass_kg": mass_kg, "sim.world.map_path": hall}

    async def scenario() -> list[tuple[str, str]]:
        async with simulated_robot(settings_of(robot_name, overrides)) as robot:
            changes = robot.daemon.bus.subscribe(SafetyChanged, size=256)
            await asyncio.sleep(1.2)
            with contextlib.suppress(CallError):  # a wheel that the ground holds up is a fault of its own
                for leg in driven:
                    await go(robot, leg)
            await asyncio.sleep(1.0)
            told = [changes.take_event() for _ in range(len(changes))]
            return [(str(event.fault), event.reason) for event in told if event.fault in ACCUSED]

    return run_virtual(scenario())


@pytest.mark.parametrize(
    "robot_name",
    [
        "chefbot",
        pytest.param("chefbot/tiva_bare", marks=pytest.mark.slow),
        pytest.param("chefbot/duemilanove", marks=pytest.mark.slow),
        pytest.param("chefbot/tiva_second", marks=pytest.mark.slow),
        pytest.param("khan", marks=pytest.mark.slow),
    ],
)
@settings(max_examples=EXAMPLES, deadline=None)
@given(mass_kg=st.sampled_from(MASSES_KG), driven=legs)
def test_a_healthy_robot_trips_no_detector(hall: Path, robot_name: str, mass_kg: float, driven: list[Leg]):
    """Twists beyond the limits, loads, reversals, stops, silences: no fault."""
    assert faults_of(hall, robot_name, mass_kg, driven) == []
