"""A turn made a scan: direction, blind sectors, range band, and turns that come twice."""

import math

import numpy as np
import pytest

from chefbotd.core.geometry import Twist2D
from chefbotd.link.lidar.turn import LidarTurn, RepeatFinder, Travel, scan_of
from chefbotd.sensing.lidar import LidarParameters


def lidar(**keywords: object) -> LidarParameters:
    """An LD19."""
    return LidarParameters.model_validate({"model": "ld19", "device": "/dev/ttyUSB0", **keywords})


def turn(*beams: tuple[float, float]) -> LidarTurn:
    """Beams of (degrees clockwise, metres), 10 ms apart, the last at 7 s."""
    degrees, metres = zip(*beams, strict=True)
    stamps = 7.0 - 0.01 * np.arange(len(beams))[::-1]
    return LidarTurn(np.radians(degrees), np.array(metres), stamps)


BEAMS = turn((10, 1.0), (100, 2.0), (200, 0.01), (300, 13.0))


def test_bearings_are_counter_clockwise() -> None:
    """10 degrees clockwise are -10; upside down the lidar turns the other way round, so +10, with the same mount."""
    scan = scan_of(lidar(), BEAMS)
    assert np.degrees(scan.bearing_rad) == pytest.approx([-10, -100, -200, -300])
    turned = scan_of(lidar(upside_down=True), BEAMS)
    assert np.degrees(turned.bearing_rad) == pytest.approx([10, 100, 200, 300])


def test_what_is_out_of_range_is_no_reading() -> None:
    """0.01 m is nearer than the LD19 sees, 13 m farther."""
    assert scan_of(lidar(), BEAMS).range_m == pytest.approx([1.0, 2.0, 0, 0])
    assert scan_of(lidar(min_range_m=1.5, max_range_m=20.0), BEAMS).range_m == pytest.approx([0, 2, 0, 13])


@pytest.mark.parametrize(("upside_down", "left"), [(False, [0, 2, 0, 0]), (True, [1, 2, 0, 0])])
def test_blind_sectors_are_counter_clockwise_seen_from_above(upside_down: bool, left: list[float]) -> None:
    """From -20 over 0 to -5 degrees: the beam 10 degrees clockwise is in it, unless the lidar hangs upside down."""
    sectors = ((math.radians(-20), math.radians(-5)),)
    scan = scan_of(lidar(blind_sectors_rad=sectors, upside_down=upside_down), BEAMS)
    assert scan.range_m == pytest.approx(left)


def test_a_blind_sector_may_go_through_half_a_turn() -> None:
    """From 150 to 210 degrees CCW: the beam at 160 degrees (200 clockwise) only."""
    scan = scan_of(lidar(blind_sectors_rad=((2.618, 3.665),), min_range_m=0.005), BEAMS)
    assert scan.range_m == pytest.approx([1, 2, 0, 0])


def test_the_scan_is_stamped_with_its_last_beam() -> None:
    """The others come before it."""
    scan = scan_of(lidar(), BEAMS)
    assert scan.stamp_s == 7.0
    assert scan.after_s == pytest.approx([-0.03, -0.02, -0.01, 0])


def varied(seed: int) -> LidarTurn:
    """A turn with noise."""
    ranges = 2 + np.random.default_rng(seed).normal(0, 0.005, 450)
    return LidarTurn(np.linspace(0, 6.2, 450), np.round(ranges, 3), np.linspace(0, 0.1, 450))


def test_a_turn_that_was_there_before_is_found() -> None:
    """One of a recording of 50 turns that begins again after 5 cm; its time does not count."""
    finder = RepeatFinder()
    assert not any(finder.is_repeated(varied(seed), 0.0) for seed in range(50))
    assert all(finder.is_repeated(varied(seed), 0.05) for seed in range(50))


def test_a_lidar_without_noise_may_repeat_itself_while_the_robot_stands() -> None:
    """As a simulated one does, for ever; after 2 cm of creeping odometry too, after 4 cm no longer."""
    finder = RepeatFinder()
    assert not any(finder.is_repeated(varied(1), 0.0) for _ in range(1000))
    assert not finder.is_repeated(varied(1), 0.02)
    assert finder.is_repeated(varied(1), 0.04)


def test_travel_counts_turning_and_driving_in_either_direction() -> None:
    """0.1 s back at 0.2 m/s are 2 cm; 0.1 s of turning at -1 rad/s are 3 cm at 0.3 m; a gap of a minute counts 0.2 s."""
    travel = Travel()
    travel.add_twist(10.0, Twist2D(5.0, 5.0))
    travel.add_twist(10.1, Twist2D(-0.2, 0.0))
    assert travel.travelled_m == pytest.approx(0.02)
    travel.add_twist(10.2, Twist2D(0.0, -1.0))
    assert travel.travelled_m == pytest.approx(0.05)
    travel.add_twist(70.2, Twist2D(0.1, 0.0))
    assert travel.travelled_m == pytest.approx(0.07)


def test_in_an_empty_hall_every_turn_is_alike_and_none_a_repetition() -> None:
    """No reading at all, or three."""
    empty = LidarTurn(np.linspace(0, 6.2, 450), np.zeros(450), np.zeros(450))
    finder = RepeatFinder()
    assert not any(finder.is_repeated(empty, 0.1 * index) for index in range(5))


def test_memory_is_bounded() -> None:
    """What came more than 600 turns ago is forgotten."""
    finder = RepeatFinder()
    for seed in range(700):
        finder.is_repeated(varied(seed), 0.0)
    assert not finder.is_repeated(varied(50), 0.1)
    assert finder.is_repeated(varied(699), 0.1)


def sunny(strength: list[float]) -> list[float]:
    """The ranges of a scan of 1 m all round but for the second and the fifth and sixth beam, with these strengths."""
    degrees = np.arange(8) * 0.8
    metres = np.array([1.0, 0.4, 1.0, 1.0, 0.5, 0.5, 1.0, 1.0])
    stamps = np.linspace(0, 0.1, 8)
    turned = LidarTurn(np.radians(degrees), metres, stamps, np.array(strength))
    return scan_of(LidarParameters(model="ld19", device="/dev/x"), turned).range_m.tolist()


def test_a_weak_reading_counts_where_a_beam_beside_it_confirms_it() -> None:
    """Of intensity 8, below LDROBOT's 15: alone it is sunlight, two side by side are a dark leg, a strong one stays."""
    assert sunny([200, 8, 200, 200, 8, 8, 200, 200]) == [1.0, 0.0, 1.0, 1.0, 0.5, 0.5, 1.0, 1.0]
    assert sunny([200, 200, 200, 200, 8, 8, 200, 200])[1] == 0.4


def test_a_lidar_whose_readings_are_all_weak_has_another_scale() -> None:
    """Nothing is left out then."""
    assert sunny([3, 3, 3, 3, 3, 3, 3, 3])[1] == 0.4
