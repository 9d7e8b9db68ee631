"""Lone points: what neither a beam beside it nor an earlier turn confirms."""

import math

import numpy as np
import pytest

from chefbotd.core.scan import Floats
from chefbotd.perception.lone_points import find_lone, has_neighbour

BEAMS = 450
BEARING_RAD = np.arange(BEAMS) * math.tau / BEAMS
SENSOR = np.zeros(2)


def points_of(range_m: Floats) -> Floats:
    """The hit points of a turn of an LD19, without those that are 0."""
    hit = range_m > 0
    return np.stack(
        [range_m[hit] * np.cos(BEARING_RAD[hit]), range_m[hit] * np.sin(BEARING_RAD[hit])], axis=1
    )


def room(half_m: float = 2.0) -> Floats:
    """The ranges in a square room of this half side."""
    return half_m / np.maximum(np.abs(np.cos(BEARING_RAD)), np.abs(np.sin(BEARING_RAD)))


def leg_at(range_m: float, bearing_rad: float, diameter_m: float = 0.02) -> Floats:
    """The ranges in that room with a round leg in it."""
    ranges = room()
    off_m = range_m * np.sin(BEARING_RAD - bearing_rad)
    along_m = range_m * np.cos(BEARING_RAD - bearing_rad)
    hit = (np.abs(off_m) < diameter_m / 2) & (along_m > 0)
    ranges[hit] = (along_m - np.sqrt(np.maximum(diameter_m**2 / 4 - off_m**2, 0)))[hit]
    return ranges


def test_a_room_has_no_lone_points() -> None:
    """Walls seen straight on and obliquely, corners: each point has a neighbour, with 1 cm of noise."""
    noise = np.random.default_rng(1).normal(0, 0.01, BEAMS)
    assert not find_lone(points_of(room() + noise), SENSOR).any()


def test_a_long_wall_is_not_lone_where_it_is_seen_at_12_degrees() -> None:
    """A wall 0.4 m to the left, seen up to 1.9 m ahead: asin(0.4 / 1.92) is 12 degrees."""
    ranges = np.zeros(BEAMS)
    side = np.abs(BEARING_RAD - 0.89) < 0.68  # 12 to 90 degrees
    ranges[side] = 0.4 / np.sin(BEARING_RAD[side])
    assert not find_lone(points_of(ranges), SENSOR).any()


@pytest.mark.parametrize("range_m", [0.15, 0.3, 0.5, 0.7])
def test_a_leg_of_two_centimetres_is_believed_at_once_up_to_seven_tenths(range_m: float) -> None:
    """450 beams are 14 mm apart at 1 m: at 0.7 m two of them hit 2 cm, wherever the leg stands between them."""
    for bearing_rad in np.linspace(1.0, 1.0 + math.tau / BEAMS, 20):
        points = points_of(leg_at(range_m, bearing_rad))
        on_leg = np.hypot(points[:, 0], points[:, 1]) < 1.0
        assert on_leg.sum() >= 2 - (range_m == 0.7)  # the last by a hair's breadth
        assert range_m == 0.7 or has_neighbour(points, SENSOR)[on_leg].all()


def test_a_leg_with_one_beam_is_believed_in_its_second_turn() -> None:
    """At 1.3 m one beam hits it: alone in the first turn, confirmed by the turn before in the second."""
    points = points_of(leg_at(1.3, BEARING_RAD[100]))
    on_leg = np.hypot(points[:, 0], points[:, 1]) < 1.5
    assert on_leg.sum() == 1
    assert find_lone(points, SENSOR)[on_leg].all()
    assert not find_lone(points, SENSOR, earlier=(points + 0.02,)).any()


def test_one_beam_between_may_be_lost() -> None:
    """Two beams on a thing with a reading of the wall between them confirm each other."""
    ranges = room()
    ranges[[100, 102]] = 0.5
    assert not find_lone(points_of(ranges), SENSOR).any()


@pytest.mark.parametrize(("share", "least"), [(0.02, 0.95), (0.1, 0.8)])
def test_noise_is_lone_nearly_always(share: float, least: float) -> None:
    """Readings at random: of those in the sun (2 %, 0.05 to 1 m) 95 % are found, of 10 % up to 2 m 80 %.

    Another noisy beam among four, or among those of two turns near the same place, makes the rest.
    """
    chance, farthest_m = np.random.default_rng(7), 1.0 if share == 0.02 else 2.0
    lone = noisy = walls = 0
    earlier: list[Floats] = []
    for _ in range(200):
        ranges, bad = room() + chance.normal(0, 0.01, BEAMS), chance.random(BEAMS) < share
        ranges[bad] = chance.uniform(0.05, farthest_m, bad.sum())
        found = find_lone(points_of(ranges), SENSOR, earlier=earlier[-2:])
        earlier.append(points_of(ranges))
        lone, noisy, walls = lone + found[bad].sum(), noisy + bad.sum(), walls + found[~bad].sum()
    assert lone / noisy > least
    assert walls / (200 * BEAMS) < 0.001


def test_few_points_and_none() -> None:
    """No point is lone where there is none; a single one is."""
    assert find_lone(np.zeros((0, 2)), SENSOR).tolist() == []
    assert find_lone(np.ones((1, 2)), SENSOR, earlier=(np.zeros((0, 2)),)).tolist() == [True]


def test_points_of_several_lidars_are_each_seen_from_their_own_place() -> None:
    """Two lidars' points in one array: the neighbour of the other lidar's first beam is no neighbour."""
    one = points_of(room())[:3]
    other = np.array([[0.5, 0.0]])
    sensors = np.array([[0.0, 0.0]] * 3 + [[1.0, 0.0]])
    assert find_lone(np.concatenate([one, other]), sensors).tolist() == [False, False, False, True]
