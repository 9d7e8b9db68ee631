"""Where an IMU's x axis points, by the direction in which the robot speeds up; and which of its readings are in time."""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.rolling import Rolling
from chefbotd.components.calibration.algorithms.step import Estimate
from chefbotd.core.events import ImuMeasured
from chefbotd.sensing.imu import ImuParameters

Flags: TypeAlias = NDArray[np.bool_]

LEAST_READINGS = 60
LAGS_S = np.arange(-0.1, 0.6, 0.01)
SILENT_S, REGULAR_SHARE, REGULAR_CYCLES = 0.2, 0.9, 3
"""After so long without a reading of the wheels, the IMU's are late until cycles last as long as usual again."""

SURE_RAD = 0.02
"""A mount that is known less well is none."""

SMOOTH_S = 0.15
STRAIGHT_M, AROUND_S = 0.004, 0.2
"""Turning accelerates an IMU that is not above the middle of the axle: so only straight motion counts."""


def in_time(stamp_s: Floats, wheels_s: Floats) -> Flags:
    """Which readings came when the board had not been silent lately, and while the wheels were heard."""
    cycles_s = np.diff(wheels_s)
    usual_s, late, waits = float(np.median(cycles_s)), np.zeros(len(wheels_s), bool), 0
    for k, cycle_s in enumerate(cycles_s.tolist(), 1):
        if cycle_s > SILENT_S or (waits and cycle_s < REGULAR_SHARE * usual_s):
            waits = REGULAR_CYCLES
        elif waits:
            waits -= 1
        late[k] = waits > 0
    inside = (stamp_s > wheels_s[0] + LAGS_S[-1]) & (stamp_s < wheels_s[-1] + LAGS_S[0])
    after = np.minimum(np.searchsorted(wheels_s, stamp_s), len(wheels_s) - 1)
    return np.asarray(inside & ~late[after] & ~late[np.maximum(after - 1, 0)], bool)


def mount_of(
    imu: ImuParameters, rolled: Rolling, readings: Sequence[ImuMeasured], lag_s: float
) -> Estimate | None:
    """The mount's heading; None without an accelerometer, or where the drive tells too little."""
    felt = [(m.stamp_s, *m.linear_acceleration_m_s2[:2]) for m in readings if m.linear_acceleration_m_s2]
    if len(felt) < LEAST_READINGS:
        return None
    stamp_s, *axes = np.array(felt).T
    way_m, apart_m = (rolled.left_m + rolled.right_m) / 2, rolled.right_m - rolled.left_m

    def at(values: Floats, after_s: float) -> Floats:
        return np.asarray(np.interp(stamp_s - lag_s + after_s, rolled.stamp_s, values))

    turned_m = np.abs(at(apart_m, AROUND_S) - at(apart_m, -AROUND_S))
    used = (turned_m < STRAIGHT_M) & in_time(stamp_s, rolled.stamp_s)
    ahead = (at(way_m, SMOOTH_S) - 2 * at(way_m, 0.0) + at(way_m, -SMOOTH_S))[used] / SMOOTH_S**2
    squares = float(((ahead - ahead.mean()) ** 2).sum()) if used.sum() >= LEAST_READINGS else 0.0
    if squares < 1.0:
        return None
    columns = np.stack([np.ones(len(ahead)), ahead], axis=1)
    fits = [np.linalg.lstsq(columns, axis[used], rcond=None)[0] for axis in axes]
    along, across = float(fits[0][1]), float(fits[1][1])
    left = axes[1][used] - columns @ fits[1]
    sigma_rad = float(left.std()) / math.sqrt(squares) / max(along, 0.1)
    if sigma_rad > SURE_RAD or along < 0.3:
        return None
    after = math.remainder(imu.mount_heading_rad - math.atan2(across, along), math.tau)
    return Estimate("imu.mount_heading_rad", "rad", imu.mount_heading_rad, after, sigma_rad)
