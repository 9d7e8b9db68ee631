"""A light simulation of ChefBot's wheels and IMU, for what takes hours of driving: constants that are off, and slip.

It is kinematics only. What disturbs it is what the simulator's plausible robot has: random slip with the variances that
the OptiOdom runs show, a heading with two decimals from a queue, which drifts and is left out of a fifth of the cycles.
"""

import math
import random
from collections.abc import Iterator

from chefbotd.core.events.robot import ImuMeasured, WheelsDriven
from chefbotd.core.record import Record
from chefbotd.motion.fused_odometry import FusedOdometry
from chefbotd.motion.odometry import BIAS_WALK_RAD_S_PER_ROOT_S, HEADING_WALK_RAD_PER_ROOT_S, FusionParameters

TRACK_M = 0.3
CYCLE_S = 0.05
TRAVEL_VARIANCE, TURN_VARIANCE = 6e-7, 2.5e-5
COUNTS_PER_M = 4200 / (math.pi * 0.09)
MISSING_SHARE = 0.19
HEADING_NOISE_RAD, GYRO_NOISE_RAD_S = 0.002, 0.001
COUNTS_PER_RAD_S = 131 * 180 / math.pi
"""The IMU's are those of the simulator's default robot, and the board's are those of the published sketch."""

CALIBRATED = FusionParameters(
    size_sigma=1e-3,
    ratio_sigma=5e-4,
    track_sigma=1e-3,
    gyro_scale_sigma=2e-3,
    gyro_bias_rad_s=1e-3,
    gyro_noise_rad_per_root_s=GYRO_NOISE_RAD_S * math.sqrt(CYCLE_S),
    heading_drift_rad_s=1e-4,
)
"""What a calibration leaves: the targets for the wheels, and an IMU that was held against them. The biases walk here
as the parameters say.
"""


class Robot(Record, frozen=True):
    """A robot as its calibration left it: shares by which size, ratio, track and gyroscope are off, and its biases."""

    size: float
    ratio: float
    track: float
    gyro_scale: float
    bias_rad_s: float
    drift_rad_s: float


def drawn(parameters: FusionParameters, chance: random.Random) -> Robot:
    """A robot whose errors have the deviations that the parameters state."""
    return Robot(
        chance.gauss(0, parameters.size_sigma),
        chance.gauss(0, parameters.ratio_sigma),
        chance.gauss(0, parameters.track_sigma),
        chance.gauss(0, parameters.gyro_scale_sigma),
        chance.gauss(0, parameters.gyro_bias_rad_s),
        chance.gauss(0, parameters.heading_drift_rad_s),
    )


class Moment(Record, frozen=True):
    """The true pose, the travel of the sides as measured, and the readings of the IMU since the moment before.

    ``slipping_s`` is for how long a wheel has been slipping; None: neither does.
    """

    stamp_s: float
    x_m: float
    y_m: float
    heading_rad: float
    left_m: float
    right_m: float
    imu: tuple[ImuMeasured, ...]
    slipping_s: float | None
    is_driven: bool


def speeds(chance: random.Random, *, may_rest: bool) -> Iterator[tuple[float, float]]:
    """The speed and the rate of a robot that is sent this way and that, cycle by cycle, within ChefBot's limits."""
    speed_m_s = rate_rad_s = 0.0
    while True:
        rests = may_rest and chance.random() < 0.15
        aim_m_s = 0.0 if rests else chance.choice((0.0, 0.1, 0.2, 0.28))
        aim_rad_s = 0.0 if rests else chance.choice((0.0, 0.0, chance.uniform(-1, 1)))
        for _ in range(chance.randrange(20, 80)):
            speed_m_s += max(min(aim_m_s - speed_m_s, 1.0 * CYCLE_S), -1.0 * CYCLE_S)
            rate_rad_s += max(min(aim_rad_s - rate_rad_s, 2.0 * CYCLE_S), -2.0 * CYCLE_S)
            yield speed_m_s, rate_rad_s


def drive(
    robot: Robot,
    seconds: float,
    chance: random.Random,
    *,
    raw_imu: bool,
    slips: tuple[float, float] | None = None,
) -> Iterator[Moment]:
    """A drive. ``slips``: every 5 s a wheel loses a share of its travel between these for half a second."""
    x_m = y_m = heading_rad = rolled_left = rolled_right = 0.0
    counted, bias_rad_s, drift_rad_s = [0, 0], robot.bias_rad_s, robot.drift_rad_s
    motion, slip = speeds(chance, may_rest=True), _Slip(slips, chance)
    drifted_rad, root_s = 0.0, math.sqrt(CYCLE_S)
    for k in range(1, round(seconds / CYCLE_S) + 1):
        stamp_s, (speed_m_s, rate_rad_s) = k * CYCLE_S, next(motion)
        way_m, turn_rad = speed_m_s * CYCLE_S, rate_rad_s * CYCLE_S
        left_m, right_m = way_m - turn_rad * TRACK_M / 2, way_m + turn_rad * TRACK_M / 2
        lost_left, lost_right = slip.lost(stamp_s, left_m, right_m)
        true_left = (left_m - lost_left) * (1 + robot.size - robot.ratio / 2) + _noise(
            chance, TRAVEL_VARIANCE, left_m
        )
        true_right = (right_m - lost_right) * (1 + robot.size + robot.ratio / 2) + _noise(
            chance, TRAVEL_VARIANCE, right_m
        )
        true_rad = (true_right - true_left) / (TRACK_M * (1 - robot.track)) + _noise(
            chance, TURN_VARIANCE, turn_rad
        )
        middle_rad, true_m = heading_rad + true_rad / 2, (true_left + true_right) / 2
        walked = BIAS_WALK_RAD_S_PER_ROOT_S * root_s
        bias_rad_s, drift_rad_s = bias_rad_s + chance.gauss(0, walked), drift_rad_s + chance.gauss(0, walked)
        drifted_rad += drift_rad_s * CYCLE_S + chance.gauss(0, HEADING_WALK_RAD_PER_ROOT_S * root_s)
        shown_rad, scale = heading_rad + true_rad, 1 + robot.gyro_scale
        if raw_imu:
            readings = _rate(stamp_s, true_rad / CYCLE_S * scale + bias_rad_s, chance)
        else:
            readings = _heading(stamp_s, shown_rad * scale + drifted_rad, chance)
        x_m, y_m = x_m + true_m * math.cos(middle_rad), y_m + true_m * math.sin(middle_rad)
        heading_rad += true_rad
        rolled_left, rolled_right = rolled_left + left_m, rolled_right + right_m
        now = [math.floor(rolled_left * COUNTS_PER_M), math.floor(rolled_right * COUNTS_PER_M)]
        sides = (now[0] - counted[0]) / COUNTS_PER_M, (now[1] - counted[1]) / COUNTS_PER_M
        counted = now
        is_driven = bool(left_m or right_m)
        yield Moment(stamp_s, x_m, y_m, heading_rad, *sides, readings, slip.since(stamp_s), is_driven)


class _Slip:
    """Which wheel loses how much of its travel."""

    EVERY_S, LASTS_S, LEAST_M_S = 5.0, 0.5, 0.1

    def __init__(self, shares: tuple[float, float] | None, chance: random.Random) -> None:
        self._shares, self._chance = shares, chance
        self._from_s, self._left, self._share = math.inf if shares is None else self.EVERY_S, True, 0.0
        self._began = False

    def lost(self, stamp_s: float, left_m: float, right_m: float) -> tuple[float, float]:
        """What each side loses in this cycle; a slip begins only with a wheel at 0.1 m/s at least."""
        if self._shares is None or stamp_s < self._from_s:
            return 0.0, 0.0
        if not self._began:
            self._left, self._share = self._chance.random() < 0.5, self._chance.uniform(*self._shares)
            if abs(left_m if self._left else right_m) < self.LEAST_M_S * CYCLE_S:
                return 0.0, 0.0
            self._began, self._from_s = True, stamp_s
        if stamp_s - self._from_s >= self.LASTS_S:
            self._began, self._from_s = False, stamp_s + self.EVERY_S
            return 0.0, 0.0
        return (self._share * left_m, 0.0) if self._left else (0.0, self._share * right_m)

    def since(self, stamp_s: float) -> float | None:
        """For how long a wheel has been slipping."""
        return stamp_s - self._from_s + CYCLE_S if self._began else None


def _noise(chance: random.Random, variance: float, amount: float) -> float:
    return chance.gauss(0, math.sqrt(variance * abs(amount))) if amount else 0.0


def _rate(stamp_s: float, rate_rad_s: float, chance: random.Random) -> tuple[ImuMeasured, ...]:
    """The gyroscope's counts for a cycle that ends now."""
    counts = round((rate_rad_s + chance.gauss(0, GYRO_NOISE_RAD_S)) * COUNTS_PER_RAD_S)
    rates = 0.0, 0.0, counts / COUNTS_PER_RAD_S
    return (ImuMeasured(stamp_s=stamp_s - CYCLE_S / 2, arrival_s=stamp_s, angular_velocity_rad_s=rates),)


def _heading(stamp_s: float, heading_rad: float, chance: random.Random) -> tuple[ImuMeasured, ...]:
    """The quaternion at the end of a cycle, with two decimals."""
    if chance.random() < MISSING_SHARE:
        return ()
    half = (heading_rad + chance.gauss(0, HEADING_NOISE_RAD)) / 2
    z, w = round(math.sin(half), 2), round(math.cos(half), 2)
    norm = math.hypot(z, w)
    orientation = 0.0, 0.0, z / norm, w / norm
    heading = 2 * math.atan2(z, w)
    return (ImuMeasured(stamp_s=stamp_s, arrival_s=stamp_s, orientation=orientation, heading_rad=heading),)


def fused(parameters: FusionParameters) -> FusedOdometry:
    """Odometry of this robot."""
    return FusedOdometry(
        parameters, track_width_m=TRACK_M, travel_variance=TRAVEL_VARIANCE, turn_variance=TURN_VARIANCE
    )


def feed(odometry: FusedOdometry, moment: Moment) -> None:
    """Hand a moment to odometry, in the order of a cycle of the board."""
    for reading in moment.imu:
        odometry.add_imu(reading)
    duty = (80, 80) if moment.is_driven else (0, 0)
    zero = (0.0, 0.0)
    odometry.add_driven(WheelsDriven(moment.stamp_s, zero, zero, zero, duty))
    odometry.add_travel(moment.stamp_s, moment.left_m, moment.right_m)
