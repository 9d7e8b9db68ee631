"""Infrared range finder (Sharp GP2Y0A02YK): an analogue voltage that falls with distance, and folds back.

Nearer than its fold (about 0.15 m) the voltage falls again, so a near object looks like a far one, and one reading
cannot tell them apart. What came before can: an object gets to the near side of the fold only through the peak. What
was too near is therefore told as ambiguous until something is seen that is certainly no such object.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from statistics import median
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.sensing.curve import MonotoneCurve

ADC_MAX = 4095

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


class InfraredParameters(Parameters):
    """The analogue input and its reference, the calibrated curve, the trusted band, the cone and the mount.

    ``curve_v_m`` are (volts, metres) from the fold outwards. An object that was too near is ambiguous until it is seen
    at ``believed_from_m`` or beyond: the sensor must sit so deep in the robot that nothing in front of the bumper, on
    the near side of the fold, gives as little as that distance's voltage (about 0.07 m for 0.40 m).
    """

    name: str = Field(default="front", min_length=1)
    channel: int = Field(default=0, ge=0, le=15)
    reference_v: float = Field(default=3.3, gt=0, le=10)
    curve_v_m: tuple[tuple[float, float], ...] = DATASHEET_CURVE_V_M
    median_window: int = Field(default=5, ge=1, le=101)
    min_range_m: float = Field(default=0.20, gt=0, le=10)
    max_range_m: float = Field(default=1.50, gt=0, le=10)
    believed_from_m: float = Field(default=0.40, gt=0, le=10)
    field_of_view_rad: float = Field(default=0.1, gt=0, le=math.pi)
    mount_x_m: float = Field(default=0.0, ge=-5, le=5)
    mount_y_m: float = Field(default=0.0, ge=-5, le=5)
    mount_heading_rad: float = Field(default=0.0, ge=-math.pi, le=math.pi)

    @model_validator(mode="after")
    def _is_a_sensor(self) -> Self:
        pairs = list(pairwise(self.curve_v_m))
        if not pairs or any(a[0] <= b[0] or a[1] >= b[1] for a, b in pairs):
            raise ValueError(f"curve_v_m must fall in volts as it grows in metres, got {self.curve_v_m}")
        ends = (
            self.curve_v_m[0][1],
            self.min_range_m,
            self.believed_from_m,
            self.max_range_m,
            self.curve_v_m[-1][1],
        )
        if sorted(ends) != list(ends) or self.min_range_m == self.max_range_m:
            raise ValueError(
                "min_range_m, believed_from_m and max_range_m must grow and lie on the curve, "
                f"got {ends[1:4]} on {ends[0]} to {ends[4]} m"
            )
        return self

    @property
    def base_from_sensor(self) -> Pose2D:
        """The sensor's mount; its beam leaves along its own x axis."""
        return Pose2D(self.mount_x_m, self.mount_y_m, self.mount_heading_rad)

    @cached_property
    def metres_by_volts(self) -> MonotoneCurve:
        """The curve, ready to be asked."""
        return MonotoneCurve(self.curve_v_m[::-1])


@dataclass(frozen=True, slots=True)
class InfraredState:
    """The latest voltages, newest last, and whether what is in front may be nearer than the fold: so at the start."""

    recent_v: tuple[float, ...] = ()
    maybe_folded: bool = True


START = InfraredState()


def interpret(
    params: InfraredParameters, state: InfraredState, stamp_s: float, adc: float
) -> tuple[InfraredState, RangeMeasured]:
    """The next state and what a 12-bit reading says; outside the trusted band it is never a distance."""
    volts = adc / ADC_MAX * params.reference_v
    recent_v = (*state.recent_v, volts)[-params.median_window :]
    distance_m = _distance_m(params, median(recent_v))
    status = _status(params, state, distance_m)
    maybe_folded = status in (RangeStatus.TOO_NEAR, RangeStatus.AMBIGUOUS)
    measured = RangeMeasured(
        stamp_s=stamp_s,
        sensor=params.name,
        status=status,
        range_m=distance_m if status is RangeStatus.OK else None,
        min_range_m=params.min_range_m,
        max_range_m=params.max_range_m,
        field_of_view_rad=params.field_of_view_rad,
    )
    return InfraredState(recent_v, maybe_folded), measured


def _distance_m(params: InfraredParameters, volts: float) -> float:
    """What the curve makes of a voltage if nothing is nearer than the fold; inf below its last point."""
    farthest_v, _ = params.curve_v_m[-1]
    return params.metres_by_volts.at(volts) if volts >= farthest_v else math.inf


def _status(params: InfraredParameters, state: InfraredState, distance_m: float) -> RangeStatus:
    if distance_m < params.min_range_m:
        return RangeStatus.TOO_NEAR
    if distance_m > params.max_range_m:
        return RangeStatus.TOO_FAR
    if state.maybe_folded and distance_m < params.believed_from_m:
        return RangeStatus.AMBIGUOUS
    return RangeStatus.OK
