"""Infrared readings: a distance, or why there is none."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.components.simulation.sensors import voltage
from chefbotd.core.events import AnalogueCounted, RangeMeasured, RangeStatus
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing.infrared import DATASHEET_CURVE_V_M, START, InfraredParameters, interpret
from tests.budget import examples

UNFILTERED = InfraredParameters(setback_m=0.10, median_window=1)
"""0.10 m behind the bumper: the near curve says 2.20 V there, so that below 2.0 V nothing is folded."""

SAMPLE_S = 0.02


def adc(volts: float) -> float:
    """The 12-bit reading of a voltage at a 3.3 V reference."""
    return volts / 3.3 * 4095


def counted(stamp_s: float, level: float) -> AnalogueCounted:
    """A reading, which arrives 4 ms after it was made."""
    return AnalogueCounted(stamp_s, stamp_s + 0.004, 0, level)


FREE_WAY_V = 0.2
"""What is read when nothing is in range."""


def readings(params: InfraredParameters, *volts: float) -> list[RangeMeasured]:
    """What a series of voltages, 20 ms apart, is taken for."""
    state, measured = START, []
    for k, each in enumerate(volts):
        state, one = interpret(params, state, counted(k * SAMPLE_S, adc(each)))
        measured.append(one)
    return measured


def statuses(params: InfraredParameters, *volts: float) -> list[str]:
    """The same in words."""
    return [str(measured.status) for measured in readings(params, *volts)]


SLOWLY = (1.25, 1.60, 1.90, 1.95, 2.0, 2.1, 2.2, 2.3, 2.35, 2.4, 2.45, 2.5, 2.55, 2.58, 2.60)
"""An object that comes closer down to 0.225 m, ever more slowly."""


@pytest.mark.parametrize(
    ("volts", "status", "range_m"),
    [
        (3.30, RangeStatus.TOO_NEAR, None),
        (2.75, RangeStatus.TOO_NEAR, None),
        (2.71, RangeStatus.TOO_NEAR, None),
        (2.00, RangeStatus.AMBIGUOUS, None),
        (1.55, RangeStatus.OK, 0.40),
        (1.25, RangeStatus.OK, 0.50),
        (0.62, RangeStatus.OK, 1.00),
        (0.40, RangeStatus.OK, 1.50),
        (0.39, RangeStatus.TOO_FAR, None),
        (0.00, RangeStatus.TOO_FAR, None),
    ],
)
def test_only_a_trusted_distance_is_one(volts: float, status: RangeStatus, range_m: float | None) -> None:
    """The data sheet's points, all of a sudden: above 0.20 m too near, below 1.50 m too far, never a number.

    What appears at 0.30 m out of nothing may have come from the side, at 0.11 m.
    """
    _, measured = readings(UNFILTERED, FREE_WAY_V, volts)
    assert measured.status is status
    assert measured.range_m == (None if range_m is None else pytest.approx(range_m))


def test_what_comes_slowly_is_a_distance_down_to_the_least() -> None:
    """At 0.50 m and then in ever smaller steps: every reading is a number, 2.40 V are 0.25 m."""
    measured = readings(UNFILTERED, *SLOWLY)
    assert [one.status for one in measured] == [RangeStatus.OK] * len(SLOWLY)
    assert measured[SLOWLY.index(2.4)].range_m == pytest.approx(0.25)


@settings(max_examples=examples(100))
@given(st.lists(st.floats(0, 4095), min_size=1, max_size=20))
def test_a_range_is_in_the_band_or_not_there(levels: list[float]) -> None:
    """Whatever the levels and their order: a number exactly when the status is ok, and within 0.20 to 1.50 m."""
    state = START
    for level in levels:
        state, measured = interpret(UNFILTERED, state, counted(0.0, level))
        assert (measured.range_m is not None) == (measured.status is RangeStatus.OK)
        assert measured.range_m is None or 0.20 <= measured.range_m <= 1.50


def test_distance_grows_as_the_voltage_falls() -> None:
    """Over the whole band in millivolts, without a step back between the points."""
    metres = [UNFILTERED.metres_by_volts.value_at(millivolts / 1000) for millivolts in range(2700, 399, -1)]
    assert all(nearer < farther for nearer, farther in pairwise(metres))


def test_what_went_behind_the_fold_is_ambiguous_and_not_far() -> None:
    """Beyond the peak 2.2 V are 0.10 m and not 0.27 m; only less than 2.0 V ends the doubt."""
    beyond = (2.72, 2.74, 2.6, 2.4, 2.2, 2.01, 1.99, 2.0)
    assert statuses(UNFILTERED, *SLOWLY, *beyond)[len(SLOWLY) :] == [
        "too_near",
        "too_near",
        "ambiguous",
        "ambiguous",
        "ambiguous",
        "ambiguous",
        "ok",
        "ok",
    ]


def test_at_the_start_a_near_object_may_be_behind_the_fold() -> None:
    """Switched on in front of a wall 0.11 m away, read as 0.25 m: no number before a far view."""
    assert statuses(UNFILTERED, 2.4, 2.4, 1.25) == ["ambiguous", "ambiguous", "ok"]


def test_an_object_that_is_gone_ends_the_doubt() -> None:
    """From too near to nothing in range, and to 0.40 m: both are believed."""
    assert statuses(UNFILTERED, 2.74, 0.2) == ["too_near", "too_far"]
    assert statuses(UNFILTERED, 2.74, 1.55) == ["too_near", "ok"]


@pytest.mark.parametrize(("gap_s", "status"), [(0.1, "ok"), (0.11, "ambiguous"), (60.0, "ambiguous")])
def test_after_a_pause_what_was_seen_before_does_not_count(gap_s: float, status: str) -> None:
    """0.23 m, then nobody looked, then 0.23 m again: after more than 0.1 s it may have come across the peak."""
    state = START
    for k, volts in enumerate(SLOWLY):
        state, _ = interpret(UNFILTERED, state, counted(k * SAMPLE_S, adc(volts)))
    last_s = state.recent[-1].stamp_s
    _, measured = interpret(UNFILTERED, state, counted(last_s + gap_s, adc(2.58)))
    assert str(measured.status) == status


def test_a_pause_forgets_what_the_median_was_made_of() -> None:
    """Five samples of 1 m, a second of silence, 0.5 m: the number is of what is there now."""
    params = InfraredParameters(setback_m=0.10, median_window=5)
    state = START
    for k in range(5):
        state, _ = interpret(params, state, counted(k * SAMPLE_S, adc(0.62)))
    _, measured = interpret(params, state, counted(1.2, adc(1.25)))
    assert measured.range_m == pytest.approx(0.5)


def test_a_fast_approach_is_doubted_before_the_peak() -> None:
    """At 1 m/s (0.02 m a sample) it may be 0.10 m closer before the next reading must be there: under 0.30 m no number.

    The median of five alone would go on telling numbers until 0.04 m after the peak.
    """
    params = InfraredParameters(setback_m=0.10, median_window=5)
    metres = [0.60 - 0.02 * k for k in range(25)]  # down to 0.12 m, across the peak at 0.15 m
    state, told = START, []
    for k, distance_m in enumerate(metres):
        state, measured = interpret(params, state, counted(k * SAMPLE_S, adc(voltage(distance_m))))
        told.append((distance_m, measured))
    assert all(one.status is RangeStatus.OK for distance_m, one in told if distance_m > 0.31)
    assert all(one.range_m is None for distance_m, one in told if distance_m < 0.29)


@pytest.mark.parametrize("metres_a_sample", [0.02, 0.05, 0.1, 0.15, 0.3])
@pytest.mark.parametrize("window", [1, 5, 21])
def test_no_number_is_told_of_what_is_behind_the_fold(metres_a_sample: float, window: int) -> None:
    """However fast it comes (up to 15 m/s), from wherever the samples fall, and whatever the median still remembers."""
    params = InfraredParameters(setback_m=0.10, median_window=window)
    for first_m in (1.0, 1.01, 1.02, 1.04, 1.07, 1.11):
        state, distance_m, stamp_s = START, first_m, 0.0
        for _ in range(80):
            state, measured = interpret(params, state, counted(stamp_s, adc(voltage(distance_m))))
            assert measured.range_m is None or distance_m > 0.15
            distance_m, stamp_s = max(0.10, distance_m - metres_a_sample), stamp_s + SAMPLE_S


def test_the_median_takes_out_spikes_and_each_sample_may_warn() -> None:
    """Two wild readings of five are never a number; the one that is too near is told to be possible, while it lasts."""
    params = InfraredParameters(setback_m=0.10, median_window=5)
    measured = readings(params, 1.25, 1.25, 1.25, 3.3, 0.0, 1.25, 0.62, 0.62, 0.62)
    ranges_m = [one.range_m for one in measured]
    assert ranges_m[3] is None
    assert measured[3].status is RangeStatus.AMBIGUOUS
    assert ranges_m[:3] + ranges_m[4:7] == pytest.approx([0.5] * 6)
    assert ranges_m[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("setback_m", "volts", "status"),
    [
        (0.05, 1.11, "ambiguous"),  # 1.30 V there, less the margin of 0.2
        (0.05, 1.09, "ok"),
        (0.0, 0.62, "ambiguous"),  # 0.50 V
        (0.0, 0.35, "ambiguous"),
        (0.0, 0.29, "too_far"),
        (0.5, 2.46, "ambiguous"),  # nothing gets beyond the fold at all, and 2.65 V is its near end
        (0.5, 2.44, "ok"),
    ],
)
def test_the_nearer_an_object_can_get_the_longer_the_doubt_lasts(
    setback_m: float, volts: float, status: str
) -> None:
    """What the near curve says of an object at the bumper, less a margin, ends it; even "too far" may be near."""
    params = InfraredParameters(setback_m=setback_m, median_window=1)
    assert statuses(params, volts) == [status]


def test_a_calibrated_curve_replaces_the_data_sheets() -> None:
    """Two points make a line: 1.5 V on (2.0 V, 0.2 m), (1.0 V, 1.2 m) are 0.7 m."""
    params = InfraredParameters(
        setback_m=0.10, curve_v_m=((2.0, 0.2), (1.0, 1.2)), max_range_m=1.2, median_window=1
    )
    assert readings(params, 1.5)[0].range_m == pytest.approx(0.7)


def test_a_reading_says_what_sensor_it_is_from() -> None:
    """Name, band and cone are those of the configuration, the time that of the bytes."""
    params = InfraredParameters(name="rear", setback_m=0.1, field_of_view_rad=0.2)
    _, measured = interpret(params, START, counted(7.5, adc(1.25)))
    assert measured == RangeMeasured(7.5, 7.504, "rear", RangeStatus.OK, measured.range_m, 0.2, 1.5, 0.2)


def test_the_mount_is_a_pose_in_the_base_frame() -> None:
    """Where the sensor sits and where it looks."""
    params = InfraredParameters(setback_m=0.0, mount_x_m=0.1, mount_y_m=-0.05, mount_heading_rad=math.pi / 2)
    assert params.base_from_sensor == Pose2D(0.1, -0.05, math.pi / 2)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"curve_v_m": DATASHEET_CURVE_V_M[:1]}, "must fall in volts as it grows in metres"),
        ({"curve_v_m": ((2.0, 0.2), (2.1, 1.5))}, "must fall in volts as it grows in metres"),
        ({"curve_v_m": ((2.0, 0.2), (1.0, 0.2))}, "must fall in volts as it grows in metres"),
        ({"near_curve_v_m": ((1.0, 0.0),)}, "near_curve_v_m must rise in volts and in metres"),
        ({"near_curve_v_m": ((1.0, 0.0), (0.9, 0.1))}, "near_curve_v_m must rise in volts and in metres"),
        ({"near_curve_v_m": ((1.0, 0.1), (2.0, 0.1))}, "near_curve_v_m must rise in volts and in metres"),
        (
            {"near_curve_v_m": ((1.0, 0.0), (2.0, 0.16))},
            r"must end where curve_v_m begins, got 0\.16 and 0\.15 m",
        ),
        ({"min_range_m": 0.1}, r"must grow and lie on the curve, got 0\.1 and 1\.5 on 0\.15 to 1\.5 m"),
        ({"max_range_m": 1.6}, r"got 0\.2 and 1\.6 on 0\.15 to 1\.5 m"),
        ({"min_range_m": 0.4, "max_range_m": 0.4}, r"got 0\.4 and 0\.4 on"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(values: dict[str, object], told: str) -> None:
    """A curve that folds, a band beyond it or without a width: named with the numbers."""
    with pytest.raises(ValidationError, match=told):
        InfraredParameters.model_validate({"setback_m": 0.1, **values})


def test_how_deep_a_sensor_sits_must_be_said() -> None:
    """Nothing can be believed of a folded reading without it, so there is no default."""
    with pytest.raises(ValidationError, match=r"setback_m\n  Field required"):
        InfraredParameters.model_validate({})
