"""What of the wheels' turning becomes motion: backlash, constant slip, and random slip."""

import math

import pytest

from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.ground import Backlash, Slip
from chefbotd.components.simulation.parameters.true import TrueParameters
from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import replace

PLAYING = replace(PUBLISHED, wheels=tuple(replace(wheel, backlash_rad=0.02) for wheel in PUBLISHED.wheels))


def test_a_wheel_follows_once_its_play_is_taken_up() -> None:
    """With 0.02 rad of play, of which 0.01 is ahead, 0.05 forward moves it 0.04; 0.015 back nothing, 0.01 more 0.005."""
    backlash = Backlash(PLAYING)
    assert backlash.turned_rad((0.0, 0.0), (0.05, 0.0)) == pytest.approx([0.04, 0.0])
    assert backlash.turned_rad((0.05, 0.0), (0.035, 0.0)) == pytest.approx([0.0, 0.0])
    assert backlash.turned_rad((0.035, 0.0), (0.025, 0.0)) == pytest.approx([-0.005, 0.0])


def test_a_wheel_without_play_turns_as_its_motor() -> None:
    """Without backlash every step arrives as it is."""
    assert Backlash(PUBLISHED).turned_rad((1.0, 2.0), (1.5, 1.0)) == pytest.approx([0.5, -1.0])


def test_a_side_loses_its_share_of_the_way() -> None:
    """A left side that slips by a quarter and a right one by a half roll 0.75 and 0.5 of a radian."""
    slip = Slip(TrueParameters(left_slip=0.25, right_slip=0.5), PUBLISHED, seed=1)
    assert slip.gripped([1.0, 1.0]) == pytest.approx([0.75, 0.5])
    slip.left = slip.right = 0.0
    assert slip.gripped([1.0, 1.0]) == pytest.approx([1.0, 1.0])


def test_random_slip_has_the_variance_of_its_parameters() -> None:
    """200 drives of 2 m and 2 rad with 1e-4 m2/m and 4e-4 rad2/rad end with variances of 2e-4 m2 and 8e-4 rad2.

    The standard error of a variance of 200 drives is a tenth of it, and three of them are allowed.
    """
    true = TrueParameters(travel_variance_m2_per_m=1e-4, turn_variance_rad2_per_rad=4e-4)
    travels, turns = [], []
    for seed in range(200):
        slip, travel_m, turn_rad = Slip(true, PUBLISHED, seed), 0.0, 0.0
        for _ in range(400):
            twist = slip.disturbed(Twist2D(0.5, 0.5), 0.01)
            travel_m, turn_rad = travel_m + twist.linear_m_s * 0.01, turn_rad + twist.angular_rad_s * 0.01
        travels.append((travel_m - 2) ** 2)
        turns.append((turn_rad - 2) ** 2)
    assert sum(travels) / 200 == pytest.approx(2e-4, rel=0.3)
    assert sum(turns) / 200 == pytest.approx(8e-4, rel=0.3)


def test_a_robot_that_stands_does_not_slip() -> None:
    """Neither travel nor turn where there is none, and no random slip unless it is asked for."""
    slipping = Slip(TrueParameters(turn_variance_rad2_per_rad=0.01), PUBLISHED, seed=1)
    assert slipping.disturbed(Twist2D(0.2, 0.0), 0.01) == Twist2D(0.2, 0.0)
    gripping = Slip(TrueParameters(), PUBLISHED, seed=1)
    assert gripping.disturbed(Twist2D(0.2, math.pi), 0.01) == Twist2D(0.2, math.pi)
