"""Finds motions that the wheels measure wrongly: a wheel that slips, a robot that is pushed, lifted or stalled."""

import math
from typing import Final

from chefbotd.core.events.robot import MotionAnomaly
from chefbotd.core.record import MutableState, Record, replace
from chefbotd.motion.motion_filter import MotionStep

WINDOW_S: Final = (0.2, 0.4)
"""Turns are compared over a quarter of a second: the shortest that is between these, as samples come."""

LAG_DOUBT_S: Final = 0.02
"""So uncertain is the time of a reading: a change of the rate by 1 rad/s then looks like a turn of 20 mrad."""

PUSHED_FACTOR: Final = 2.0
MOST_PUSHED_RAD_S: Final = 3.0
"""Nobody turns a robot faster by hand. What jumps farther from one sample to the next is no motion but an outlier."""

MOST_OUTLIERS: Final = 2
QUIET_S: Final = 0.3
"""An anomaly is over when it has not been seen for so long."""

STALLED_S: Final = 0.5
STALLED_SHARE: Final = 0.1
STALLED_FROM_RAD_S: Final = 0.3


class TurnSample(Record, frozen=True):
    """The headings by IMU and wheels at a time (rad), and the farthest that slipping wheels could have turned the robot.

    ``reach_rad`` is a sum like the headings: twice the way of the faster wheel over the track.
    """

    stamp_s: float
    by_imu_rad: float
    by_wheels_rad: float
    reach_rad: float


class TurnWatch(MutableState):
    """Compares the turns by wheels and IMU over the last quarter of a second.

    ``slip_s`` and ``push_s`` are when the two were last seen, ``in_a_row`` by how many samples.
    """

    samples: list[TurnSample] = []
    outliers: int = 0
    slip_s: float = -math.inf
    push_s: float = -math.inf
    in_a_row: int = 0

    def add(self, sample: TurnSample, limit_rad: float, share: float, *, may_slip: bool) -> float:
        """Add a sample; how far the turns differ (rad) where the second sample in a row shows an anomaly, else 0.

        A difference of ``limit_rad``, and of a ``share`` of the turn, is none. ``may_slip`` False: a skid steer, whose
        wheels slip in every turn; only a push is seen.
        """
        samples, now_s = self.samples, sample.stamp_s
        if samples and self._is_outlier(samples[-1], sample, limit_rad):
            return 0.0
        samples.append(sample)
        while samples[0].stamp_s < now_s - WINDOW_S[1]:
            del samples[0]
        before = next((s for s in reversed(samples) if s.stamp_s <= now_s - WINDOW_S[0]), None)
        if before is None:
            return 0.0
        by_wheels_rad = sample.by_wheels_rad - before.by_wheels_rad
        off_rad = sample.by_imu_rad - before.by_imu_rad - by_wheels_rad
        moved = sample.reach_rad - before.reach_rad > limit_rad / 2
        allowed_rad = limit_rad * (1.0 if moved else PUSHED_FACTOR) + share * abs(by_wheels_rad)
        if (moved and not may_slip) or abs(off_rad) <= allowed_rad + LAG_DOUBT_S * _rate_change(samples):
            self.in_a_row = 0
            return 0.0
        self.in_a_row += 1
        if moved:
            self.slip_s = now_s
        else:
            self.push_s = now_s
        return off_rad if self.in_a_row == 2 else 0.0

    def _is_outlier(self, last: TurnSample, sample: TurnSample, limit_rad: float) -> bool:
        """Whether the IMU has jumped farther than a robot turns; after two of these it has, and all begins anew."""
        turned_rad = sample.by_imu_rad - last.by_imu_rad - sample.by_wheels_rad + last.by_wheels_rad
        most_rad = limit_rad + sample.reach_rad - last.reach_rad
        if abs(turned_rad) <= most_rad + MOST_PUSHED_RAD_S * (sample.stamp_s - last.stamp_s):
            self.outliers = 0
            return False
        self.outliers += 1
        if self.outliers > MOST_OUTLIERS:
            self.clear()
        return self.outliers > 0

    def clear(self) -> None:
        """Forget the samples."""
        self.samples.clear()
        self.outliers = self.in_a_row = 0


def _rate_change(samples: list[TurnSample]) -> float:
    """How much the turning rate by the wheels changes within the window (rad/s); it has two samples at least."""
    return abs(_rate(samples[-2], samples[-1]) - _rate(samples[0], samples[1]))


def _rate(before: TurnSample, after: TurnSample) -> float:
    return (after.by_wheels_rad - before.by_wheels_rad) / max(after.stamp_s - before.stamp_s, 1e-3)


class StallWatch(MutableState):
    """Whether a wheel that is to turn has stood for half a second; ``since_s`` is since when."""

    since_s: float | None = None
    is_stalled: bool = False
    is_unpowered: bool = False

    def add(
        self,
        stamp_s: float,
        velocity_rad_s: tuple[float, ...],
        target_rad_s: tuple[float, ...],
        duty: tuple[int, ...],
    ) -> None:
        """Add a control step."""
        self.is_unpowered = not any(duty)
        stands = any(
            abs(target) > STALLED_FROM_RAD_S and abs(velocity) < STALLED_SHARE * abs(target)
            for velocity, target in zip(velocity_rad_s, target_rad_s, strict=True)
        )
        if not stands or self.is_unpowered:
            self.since_s, self.is_stalled = None, False
        elif self.since_s is None:
            self.since_s = stamp_s
        else:
            self.is_stalled = stamp_s - self.since_s >= STALLED_S


SLIP_VARIANCE_M2_PER_M: Final = 0.02
"""While a wheel slips, half of a travel of 0.1 m may be lost, one sigma. It is assumed, as are the next ones."""

SLIP_VARIANCE_RAD2_PER_S: Final = 0.02
LIFTED_VARIANCE_M2_PER_S: Final = 0.01
LIFTED_VARIANCE_RAD2_PER_S: Final = 0.05
PUSHED_VARIANCE_M2_PER_S: Final = 0.02


def widened_step(step: MotionStep, anomaly: MotionAnomaly) -> MotionStep:
    """The step with the variances of an anomaly; a gyroscope's turn is as certain as before."""
    match anomaly:
        case MotionAnomaly.LIFTED:
            travel_m2, turned_rad2 = (
                LIFTED_VARIANCE_M2_PER_S * step.dt_s,
                LIFTED_VARIANCE_RAD2_PER_S * step.dt_s,
            )
        case MotionAnomaly.PUSHED:
            travel_m2, turned_rad2 = (
                PUSHED_VARIANCE_M2_PER_S * step.dt_s,
                SLIP_VARIANCE_RAD2_PER_S * step.dt_s,
            )
        case _:
            travel_m2, turned_rad2 = (
                SLIP_VARIANCE_M2_PER_M * abs(step.travel_m),
                SLIP_VARIANCE_RAD2_PER_S * step.dt_s,
            )
    return replace(
        step,
        travel_variance_m2=step.travel_variance_m2 + travel_m2,
        turn_variance_rad2=step.turn_variance_rad2 + (0.0 if step.bias_turns else turned_rad2),
    )
