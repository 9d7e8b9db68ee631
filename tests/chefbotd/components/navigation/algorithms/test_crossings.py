"""Who crosses the robot's way and waits for nobody is not touched, at any angle, speed and phase that allow it."""

import math

import pytest

from tests.chefbotd.components.navigation.algorithms.crossings import INTO, OPEN, Crossing, met

LEFT, RIGHT = math.pi / 2, -math.pi / 2
NEVER = (math.inf, math.inf)
PHASES_S = (0.0, 0.025, 0.05, 0.075)


def test_who_crosses_behind_a_door_is_let_pass() -> None:
    """At 0.8 m/s, while the board is silent for the second in which the robot comes to the door."""
    found = met(Crossing(INTO, LEFT, 0.8, 0.5, 0.025, (6.0, 7.0)))
    assert not found.touched
    assert found.reached


@pytest.mark.slow
@pytest.mark.parametrize("phase_s", PHASES_S)
@pytest.mark.parametrize("angle_deg", [40, 75, 115, 150, 220, 255, 290, 320])
def test_who_crosses_a_hall_is_not_touched(angle_deg: int, phase_s: float) -> None:
    """Before the robot and after it: no touch that braking would have avoided."""
    for speed_m_s, late_s in ((0.5, 0.6), (1.1, -0.5)):
        found = met(Crossing(OPEN, math.radians(angle_deg), speed_m_s, late_s, phase_s))
        assert not found.own, (speed_m_s, late_s, found)


@pytest.mark.slow
@pytest.mark.parametrize("silent_s", [NEVER, (5.5, 6.5), (6.0, 7.0)])
@pytest.mark.parametrize("phase_s", PHASES_S)
@pytest.mark.parametrize("angle_rad", [LEFT, RIGHT])
def test_who_walks_along_a_corridor_is_not_touched_by_who_comes_out_of_a_door(
    angle_rad: float, phase_s: float, silent_s: tuple[float, float]
) -> None:
    """The goal is on his way; also where the board is silent for a second before, or in, the door."""
    for speed_m_s, late_s in ((0.5, 0.0), (0.8, 1.0), (1.2, -1.0)):
        found = met(Crossing(INTO, angle_rad, speed_m_s, late_s, phase_s, silent_s))
        assert not found.own, (speed_m_s, late_s, found)
