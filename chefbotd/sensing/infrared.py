"""Infrared range finder (Sharp GP2Y0A02YK): an analogue voltage that falls with distance, and folds back.

Nearer than the fold (about 0.15 m) the voltage falls again, so a near object looks like a far one. One reading cannot
tell them apart, but the readings before it can: an object that comes closer reaches the near side of the fold only
through the peak voltage.

So a reading is ambiguous from the moment at which an object may have got past the peak. That is after a sample that
was too near, after one that the next sample would find too near at the present pace, after a pause without samples,
and at the start. Every single sample counts for this, not only the median. The reading stays ambiguous until a voltage
is seen that nothing on the near side can cause. The lowest voltage there comes from an object that touches the robot,
which is ``setback_m`` from the sensor.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from statistics import median
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.events import AnalogueCounted, RangeMeasured, RangeStatus
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record


class MonotoneCurve:
    """Piecewise cubic Hermite interpolation that keeps the data's monotony, flat beyond both ends.

    Method: Fritsch and Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17, 1980, with the slopes
    of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984) and the end slopes of Moler, *Numerical Computing with
    MATLAB*, 3.4.
    """

    def __init__(self, points: Sequence[tuple[float, float]]) -> None:
        """Raises ``ValueError`` unless there are two points or more, (x, y), with increasing x."""
        if len(points) < 2 or any(a[0] >= b[0] for a, b in pairwise(points)):
            raise ValueError(f"a curve needs two points or more with increasing x, got {list(points)}")
        self._x = [x for x, _ in points]
        self._y = [y for _, y in points]
        self._slopes = _slopes(self._x, self._y)

    def value_at(self, x: float) -> float:
        """The curve's value; beyond its ends that of the nearest one."""
        if x <= self._x[0]:
            return self._y[0]
        if x >= self._x[-1]:
            return self._y[-1]
        k = bisect_right(self._x, x) - 1
        width = self._x[k + 1] - self._x[k]
        t = (x - self._x[k]) / width
        from_left = (1 + 2 * t) * self._y[k] + t * width * self._slopes[k]
        from_right = (3 - 2 * t) * self._y[k + 1] + (t - 1) * width * self._slopes[k + 1]
        return (1 - t) ** 2 * from_left + t**2 * from_right


def _slopes(x: Sequence[float], y: Sequence[float]) -> list[float]:
    """The slope of the curve at every point."""
    widths = [b - a for a, b in pairwise(x)]
    rises = [(b - a) / width for (a, b), width in zip(pairwise(y), widths, strict=True)]
    if len(rises) == 1:
        return [rises[0], rises[0]]
    inner = [_inner_slope(*pair) for pair in zip(pairwise(widths), pairwise(rises), strict=True)]
    first = _end_slope(widths[0], widths[1], rises[0], rises[1])
    last = _end_slope(widths[-1], widths[-2], rises[-1], rises[-2])
    return [first, *inner, last]


def _inner_slope(widths: tuple[float, float], rises: tuple[float, float]) -> float:
    """A weighted harmonic mean of the rises on both sides; level where they differ in sign."""
    (left_width, right_width), (left, right) = widths, rises
    if left * right <= 0:
        return 0.0
    left_weight, right_weight = 2 * right_width + left_width, right_width + 2 * left_width
    return (left_weight + right_weight) / (left_weight / left + right_weight / right)


def _end_slope(width: float, next_width: float, rise: float, next_rise: float) -> float:
    """A three-point estimate, limited so that the end stays monotone."""
    slope = ((2 * width + next_width) * rise - width * next_rise) / (width + next_width)
    if slope * rise <= 0:
        return 0.0
    if rise * next_rise < 0 and abs(slope) > 3 * abs(rise):
        return 3 * rise
    return slope


DATASHEET_CURVE_V_M = (
    (2.75, 0.15),
    (2.70, 0.20),
    (2.40, 0.25),
    (2.00, 0.30),
    (1.55, 0.40),
    (1.25, 0.50),
    (1.03, 0.60),
    (0.78, 0.80),
    (0.62, 1.00),
    (0.51, 1.20),
    (0.40, 1.50),
)
"""Volts and metres, as the data sheet's figure shows them: from the fold outwards nearly 0.62 V m over the distance."""

DATASHEET_NEAR_CURVE_V_M = ((0.50, 0.0), (1.30, 0.05), (2.20, 0.10), (2.65, 0.13))
"""The same figure before the fold: volts that rise with the metres."""

MARGIN_V = 0.2
"""Sensors, cards and supplies differ: only so much below what the near curve says is certain to be beyond the fold."""


class InfraredParameters(Parameters):
    """The analogue input and its reference, the calibrated curves, the trusted band, the cone and the mount.

    A reading of ``adc_bits`` ones is ``reference_v``: 12 bits of a Tiva, 10 of an Arduino Uno (at 5 V), 16 of others.
    ``curve_v_m`` are (volts, metres) from the fold outwards, ``near_curve_v_m`` those from the sensor to the fold.
    ``setback_m`` is how far the sensor sits behind the foremost part of the robot, along its beam: no object gets
    nearer to the sensor than that. With 0.10 m, an ambiguous reading is trusted again below 2.0 V (from 0.30 m on);
    with 0, only when nothing at all is in sight. The sensor reads by ``offset_m`` too far. After ``max_gap_s`` without
    a reading the earlier readings no longer count; an object that could cross the peak in that time, at its present
    pace, makes the reading ambiguous as well. Only the robot's description needs ``mount_z_m``, the height above the
    floor; the default is that of the axles.
    """

    name: str = Field(default="front", min_length=1)
    """The sensor's name in topics and messages."""
    channel: int = Field(default=0, ge=0, le=15)
    """The place of its reading among the analogue values of the board's line."""
    reference_v: float = Field(default=3.3, gt=0, le=10)
    """The voltage at which the analogue input reads its full scale."""
    adc_bits: int = Field(default=12, ge=8, le=24)
    """The resolution of the analogue input: 12 bits of a Tiva, 10 of an Arduino Uno."""
    curve_v_m: tuple[tuple[float, float], ...] = DATASHEET_CURVE_V_M
    """Pairs of volts and metres, from the fold of the curve outwards."""
    near_curve_v_m: tuple[tuple[float, float], ...] = DATASHEET_NEAR_CURVE_V_M
    """Pairs of volts and metres, from the sensor to the fold of the curve."""
    setback_m: float = Field(ge=0, le=2)
    offset_m: float = Field(default=0.0, ge=-0.5, le=0.5)
    """The sensor reads so much too far."""
    max_gap_s: float = Field(default=0.1, gt=0, le=10)
    median_window: int = Field(default=5, ge=1, le=101)
    """The reading is the median of the last so many."""
    min_range_m: float = Field(default=0.20, gt=0, le=10)
    """Nearer readings are not trusted."""
    max_range_m: float = Field(default=1.50, gt=0, le=10)
    """Farther readings count as nothing in sight."""
    field_of_view_rad: float = Field(default=0.1, gt=0, le=math.pi)
    """The full angle of its cone."""
    mount_x_m: float = Field(default=0.0, ge=-5, le=5)
    """How far ahead of the wheels' middle it is."""
    mount_y_m: float = Field(default=0.0, ge=-5, le=5)
    """How far to the left of the robot's middle it is."""
    mount_z_m: float | None = Field(default=None, ge=0, le=5)
    """Its height above the floor, for the description; left out, that of the axles."""
    mount_heading_rad: float = Field(default=0.0, ge=-math.pi, le=math.pi)
    """Where it points, counter-clockwise from straight ahead."""

    @model_validator(mode="after")
    def _is_a_sensor(self) -> Self:
        pairs = list(pairwise(self.curve_v_m))
        if not pairs or any(a[0] <= b[0] or a[1] >= b[1] for a, b in pairs):
            raise ValueError(f"curve_v_m must fall in volts as it grows in metres, got {self.curve_v_m}")
        near = list(pairwise(self.near_curve_v_m))
        if not near or any(a[0] >= b[0] or a[1] >= b[1] for a, b in near):
            raise ValueError(f"near_curve_v_m must rise in volts and in metres, got {self.near_curve_v_m}")
        nearest_m, farthest_m, fold_m = (
            self.curve_v_m[0][1],
            self.curve_v_m[-1][1],
            self.near_curve_v_m[-1][1],
        )
        if fold_m > nearest_m:
            raise ValueError(
                f"near_curve_v_m must end where curve_v_m begins, got {fold_m} and {nearest_m} m"
            )
        if not nearest_m <= self.min_range_m < self.max_range_m <= farthest_m:
            raise ValueError(
                "min_range_m and max_range_m must grow and lie on the curve, "
                f"got {self.min_range_m} and {self.max_range_m} on {nearest_m} to {farthest_m} m"
            )
        return self

    @property
    def base_from_sensor(self) -> Pose2D:
        """The sensor's mount; its beam leaves along its own x axis."""
        return Pose2D(self.mount_x_m, self.mount_y_m, self.mount_heading_rad)

    @cached_property
    def volts_per_count(self) -> float:
        """What one step of the ADC is."""
        return self.reference_v / ((1 << self.adc_bits) - 1)

    @cached_property
    def metres_by_volts(self) -> MonotoneCurve:
        """The curve from volts to metres."""
        return MonotoneCurve(self.curve_v_m[::-1])

    @cached_property
    def certain_below_v(self) -> float:
        """No object on the near side of the fold causes a voltage as low as this."""
        volts_by_metres = MonotoneCurve([(metres, volts) for volts, metres in self.near_curve_v_m])
        return volts_by_metres.value_at(self.setback_m) - MARGIN_V


class InfraredSample(Record, frozen=True, array_like=True):
    """A voltage, and when it was measured."""

    volts: float
    stamp_s: float


class InfraredState(Record, frozen=True):
    """The latest samples, newest last, and whether an object may be nearer than the fold: at the start it may."""

    recent: tuple[InfraredSample, ...] = ()
    maybe_folded: bool = True


START = InfraredState()


def interpret(
    params: InfraredParameters, state: InfraredState, counted: AnalogueCounted
) -> tuple[InfraredState, RangeMeasured]:
    """The next state and what a reading says; outside the trusted band it is never a distance."""
    stamp_s = counted.stamp_s
    if state.recent and stamp_s - state.recent[-1].stamp_s > params.max_gap_s:
        state = START
    sample = InfraredSample(counted.adc * params.volts_per_count, stamp_s)
    recent = (*state.recent, sample)[-params.median_window :]
    middle_v = median([earlier.volts for earlier in recent])
    is_certain = max(middle_v, sample.volts) < params.certain_below_v
    maybe_folded = not is_certain and (state.maybe_folded or _may_fold(params, state.recent, sample))
    distance_m = _distance_m(params, middle_v)
    status = _status(params, distance_m, maybe_folded)
    measured = RangeMeasured(
        stamp_s=stamp_s,
        arrival_s=counted.arrival_s,
        sensor=params.name,
        status=status,
        range_m=distance_m if status is RangeStatus.OK else None,
        min_range_m=params.min_range_m,
        max_range_m=params.max_range_m,
        field_of_view_rad=params.field_of_view_rad,
    )
    return InfraredState(recent, maybe_folded), measured


def _may_fold(params: InfraredParameters, before: tuple[InfraredSample, ...], sample: InfraredSample) -> bool:
    """Whether an object in this sample is too near, or may be past the peak before the next sample is due.

    An object that was not in sight before may have come from the side, at any speed.
    """
    distance_m = _distance_m(params, sample.volts)
    if distance_m < params.min_range_m or not before:
        return True
    before_m, elapsed_s = _distance_m(params, before[-1].volts), sample.stamp_s - before[-1].stamp_s
    if before_m <= distance_m:
        return False
    return (before_m - distance_m) * params.max_gap_s > (distance_m - params.min_range_m) * elapsed_s


def _distance_m(params: InfraredParameters, volts: float) -> float:
    """The distance of a voltage if no object is nearer than the fold; infinity below the last point of the curve."""
    farthest_v, _ = params.curve_v_m[-1]
    return params.metres_by_volts.value_at(volts) - params.offset_m if volts >= farthest_v else math.inf


def _status(params: InfraredParameters, distance_m: float, maybe_folded: bool) -> RangeStatus:
    if distance_m < params.min_range_m:
        return RangeStatus.TOO_NEAR
    if maybe_folded:
        return RangeStatus.AMBIGUOUS
    return RangeStatus.TOO_FAR if distance_m > params.max_range_m else RangeStatus.OK
