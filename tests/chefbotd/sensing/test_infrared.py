"""Infrared readings: a distance, or why there is none."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing.infrared import DATASHEET_CURVE_V_M, START, InfraredParameters, interpret

UNFILTERED = InfraredParameters(median_window=1)


def adc(volts: float) -> float:
    """The 12-bit reading of a voltage at a 3.3 V reference."""
    return volts / 3.3 * 4095


FREE_WAY_V = 0.2
"""What is read when nothing is in range."""


def readings(params: InfraredParameters, *volts: float) -> list[RangeMeasured]:
    """What a series of voltages is taken for."""
    state, measured = START, []
    for each in volts:
        state, one = interpret(params, state, 0.0, adc(each))
        measured.append(one)
    return measured


@pytest.mark.parametrize(
    ("volts", "status", "range_m"),
    [
        (3.30, RangeStatus.TOO_NEAR, None),
        (2.75, RangeStatus.TOO_NEAR, None),
        (2.71, RangeStatus.TOO_NEAR, None),
        (2.70, RangeStatus.OK, 0.20),
        (2.00, RangeStatus.OK, 0.30),
        (1.25, RangeStatus.OK, 0.50),
        (0.62, RangeStatus.OK, 1.00),
        (0.40, RangeStatus.OK, 1.50),
        (0.39, RangeStatus.TOO_FAR, None),
        (0.00, RangeStatus.TOO_FAR, None),
    ],
)
def test_only_a_trusted_distance_is_one(volts: float, status: RangeStatus, range_m: float | None) -> None:
    """The data sheet's points from 0.20 to 1.50 m; above them too near, below them too far, never a number."""
    _, measured = readings(UNFILTERED, FREE_WAY_V, volts)
    assert measured.status is status
    assert measured.range_m == (None if range_m is None else pytest.approx(range_m))


@settings(max_examples=100)
@given(st.lists(st.floats(0, 4095), min_size=1, max_size=20))
def test_a_range_is_in_the_band_or_not_there(levels: list[float]) -> None:
    """Whatever the levels and their order: a number exactly when the status is ok, and within 0.20 to 1.50 m."""
    state = START
    for level in levels:
        state, measured = interpret(UNFILTERED, state, 0.0, level)
        assert (measured.range_m is not None) == (measured.status is RangeStatus.OK)
        assert measured.range_m is None or 0.20 <= measured.range_m <= 1.50


def test_distance_grows_as_the_voltage_falls() -> None:
    """Over the whole band in millivolts, without a step back between the points."""
    metres = [UNFILTERED.metres_by_volts.at(millivolts / 1000) for millivolts in range(2700, 399, -1)]
    assert all(nearer < farther for nearer, farther in pairwise(metres))


def test_what_went_behind_the_fold_is_ambiguous_and_not_far() -> None:
    """Beyond the peak 2.0 V are 0.10 m and not 0.30 m; only 1.55 V, believed from 0.40 m, end the doubt."""
    volts = (FREE_WAY_V, 2.0, 2.7, 2.74, 2.6, 2.0, 1.6, 1.55, 2.0)
    assert [str(measured.status) for measured in readings(UNFILTERED, *volts)[1:]] == [
        "ok",
        "ok",
        "too_near",
        "ambiguous",
        "ambiguous",
        "ambiguous",
        "ok",
        "ok",
    ]


def test_at_the_start_a_near_object_may_be_behind_the_fold() -> None:
    """Switched on in front of a wall 0.12 m away, read as 0.24 m: no number before a far view."""
    statuses = [str(measured.status) for measured in readings(UNFILTERED, 2.4, 2.4, 1.25, 2.4)]
    assert statuses == ["ambiguous", "ambiguous", "ok", "ok"]


def test_an_object_that_is_gone_ends_the_doubt() -> None:
    """From too near to nothing in range: what comes next is believed."""
    statuses = [measured.status for measured in readings(UNFILTERED, 2.74, 0.2, 2.0)]
    assert statuses == [RangeStatus.TOO_NEAR, RangeStatus.TOO_FAR, RangeStatus.OK]


def test_the_median_takes_out_spikes() -> None:
    """Two wild readings of five change nothing; three are the new truth."""
    params = InfraredParameters(median_window=5)
    measured = readings(params, 1.25, 1.25, 1.25, 3.3, 0.0, 1.25, 0.62, 0.62, 0.62)
    assert [one.range_m for one in measured[:7]] == pytest.approx([0.5] * 7)
    assert measured[-1].range_m == pytest.approx(1.0)


def test_a_calibrated_curve_replaces_the_data_sheets() -> None:
    """Two points make a line: 1.5 V on (2.0 V, 0.2 m), (1.0 V, 1.2 m) are 0.7 m."""
    params = InfraredParameters(
        curve_v_m=((2.0, 0.2), (1.0, 1.2)), max_range_m=1.2, believed_from_m=0.3, median_window=1
    )
    assert readings(params, 1.5)[0].range_m == pytest.approx(0.7)


def test_a_reading_says_what_sensor_it_is_from() -> None:
    """Name, band and cone are those of the configuration, the time that of the bytes."""
    params = InfraredParameters(name="rear", field_of_view_rad=0.2)
    _, measured = interpret(params, START, 7.5, adc(1.25))
    assert measured == RangeMeasured(7.5, "rear", RangeStatus.OK, measured.range_m, 0.2, 1.5, 0.2)


def test_the_mount_is_a_pose_in_the_base_frame() -> None:
    """Where the sensor sits and where it looks."""
    params = InfraredParameters(mount_x_m=0.1, mount_y_m=-0.05, mount_heading_rad=math.pi / 2)
    assert params.base_from_sensor == Pose2D(0.1, -0.05, math.pi / 2)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"curve_v_m": DATASHEET_CURVE_V_M[:1]}, "must fall in volts as it grows in metres"),
        ({"curve_v_m": ((2.0, 0.2), (2.1, 1.5))}, "must fall in volts as it grows in metres"),
        ({"curve_v_m": ((2.0, 0.2), (1.0, 0.2))}, "must fall in volts as it grows in metres"),
        (
            {"min_range_m": 0.1},
            r"must grow and lie on the curve, got \(0\.1, 0\.4, 1\.5\) on 0\.15 to 1\.5 m",
        ),
        ({"max_range_m": 1.6}, r"got \(0\.2, 0\.4, 1\.6\) on 0\.15 to 1\.5 m"),
        ({"believed_from_m": 0.18}, r"got \(0\.2, 0\.18, 1\.5\)"),
        ({"min_range_m": 0.4, "max_range_m": 0.4}, r"got \(0\.4, 0\.4, 0\.4\)"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(values: dict[str, object], told: str) -> None:
    """A curve that folds, a band beyond it or without a width: named with the numbers."""
    with pytest.raises(ValidationError, match=told):
        InfraredParameters.model_validate(values)
