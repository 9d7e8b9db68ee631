"""The correction that others are told: bounded where the robot is, and never silent about a jump."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.localizer import correct_odom
from chefbotd.core.poses import between, compose

FAR_AWAY = np.array([40.0, -25.0, 2.1])
"""Where odometry says the robot is: far from its origin, where a small turn of the frame moves it by much."""


def test_a_small_correction_glides_along_at_the_rate() -> None:
    """Off by (0.16, 0.12), which is 0.2 m: at 0.2 m/s it is 0.02 m nearer after 0.1 s, and right after 1 s."""
    published = np.array([1.0, 2.0, 0.3])
    here = compose(published, FAR_AWAY)
    right = here + np.array([0.16, 0.12, 0.0])
    first, jumped = correct_odom(published, right, FAR_AWAY, 0.1)
    shown = compose(first, FAR_AWAY)
    assert not jumped
    assert shown[:2] - here[:2] == pytest.approx([0.016, 0.012], abs=1e-9)
    for _ in range(10):
        published, _ = correct_odom(published, right, FAR_AWAY, 0.1)
    assert compose(published, FAR_AWAY) == pytest.approx(right, abs=1e-9)


def test_a_turn_is_corrected_about_the_robot() -> None:
    """A heading that is 0.1 rad off turns by 0.035 rad in 0.1 s, and the robot's place does not move at all."""
    published = np.array([-3.0, 0.5, -0.7])
    here = compose(published, FAR_AWAY)
    map_from_odom, _ = correct_odom(published, here + np.array([0, 0, 0.1]), FAR_AWAY, 0.1)
    off = between(here, compose(map_from_odom, FAR_AWAY))
    assert off == pytest.approx([0, 0, 0.035], abs=1e-9)


@pytest.mark.parametrize("off", [(0.25, 0.2, 0.0), (0.0, 0.0, -0.4)])
def test_what_is_too_far_jumps_and_says_so(off: tuple[float, float, float]) -> None:
    """By 0.32 m or 0.4 rad nobody glides: the right pose is published at once."""
    published = np.array([1.0, 2.0, 0.3])
    right = compose(published, FAR_AWAY) + np.array(off)
    map_from_odom, jumped = correct_odom(published, right, FAR_AWAY, 0.1)
    assert jumped
    assert math.dist(compose(map_from_odom, FAR_AWAY)[:2], right[:2]) < 1e-9


def test_nothing_to_correct_changes_nothing() -> None:
    """The frame stays bit for bit where it was, however the robot drives."""
    published = np.array([1.0, 2.0, 0.3])
    map_from_odom, jumped = correct_odom(published, compose(published, FAR_AWAY), FAR_AWAY, 0.1)
    assert map_from_odom == pytest.approx(published, abs=1e-12)
    assert not jumped
