"""Ultrasonic readings: a distance, or why there is none."""

import math

import pytest
from pydantic import ValidationError

from chefbotd.core.events import RangeMeasured, RangeStatus, UltrasonicEchoed
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing.ultrasonic import UltrasonicParameters, interpret


@pytest.mark.parametrize(
    ("distance_cm", "status", "range_m"),
    [
        (0, RangeStatus.NO_ECHO, None),
        (1, RangeStatus.TOO_NEAR, None),
        (2, RangeStatus.OK, 0.02),
        (137, RangeStatus.OK, 1.37),
        (400, RangeStatus.OK, 4.0),
        (401, RangeStatus.TOO_FAR, None),
        (3000, RangeStatus.TOO_FAR, None),
    ],
)
def test_only_a_trusted_distance_is_one(distance_cm: int, status: RangeStatus, range_m: float | None) -> None:
    """0.02 to 4 m is a range; nearer, farther and nothing at all are told apart."""
    measured = interpret(UltrasonicParameters(), UltrasonicEchoed(5.0, 5.1, distance_cm))
    assert (measured.status, measured.range_m) == (status, range_m)


def test_the_offset_is_taken_off() -> None:
    """A sensor that reads 2 cm too far: 1.37 m are 1.35 m, 4.01 m are in its band, and no echo remains none."""
    params = UltrasonicParameters(offset_m=0.02)
    measured = [interpret(params, UltrasonicEchoed(5.0, 5.1, cm)) for cm in (137, 401, 0)]
    assert [one.range_m for one in measured] == pytest.approx([1.35, 3.99, None])
    assert measured[2].status is RangeStatus.NO_ECHO


def test_a_reading_says_what_sensor_it_is_from() -> None:
    """Name, band and cone are those of the configuration, the time that of the bytes."""
    params = UltrasonicParameters(name="rear", min_range_m=0.1, max_range_m=2.0, field_of_view_rad=0.5)
    assert interpret(params, UltrasonicEchoed(7.5, 7.6, 50)) == RangeMeasured(
        7.5, 7.6, "rear", RangeStatus.OK, 0.5, 0.1, 2.0, 0.5
    )


def test_the_mount_is_a_pose_in_the_base_frame() -> None:
    """Where the sensor sits and where it looks."""
    params = UltrasonicParameters(mount_x_m=0.1, mount_y_m=-0.05, mount_heading_rad=math.pi / 2)
    assert params.base_from_sensor == Pose2D(0.1, -0.05, math.pi / 2)


def test_an_empty_band_is_refused() -> None:
    """A nearest range beyond the farthest is a mistake, and both are said."""
    with pytest.raises(ValidationError, match=r"below max_range_m, got 2\.0 and 1\.0"):
        UltrasonicParameters(min_range_m=2.0, max_range_m=1.0)


def test_a_band_has_a_width():
    """A least range that is the greatest leaves nothing to be told."""
    with pytest.raises(ValidationError, match=r"min_range_m must be below max_range_m, got 0\.5 and 0\.5"):
        UltrasonicParameters(min_range_m=0.5, max_range_m=0.5)
