"""The fit of the step ``imu``, and whether it may be believed.

A board's unwrapped heading, or the sum of its rates, is ``offset + bias t + scale H(t - lag)``, where H is the heading
by the wheels, put right by the lidar from stop to stop. While the board is silent, its IMU's queue fills up, and what
follows is late by another lag: that is left out.

Rest is where the wheels stand, the motors have no duty, and the rates hardly vary: a robot can turn while its wheels
stand.
"""

import math
from itertools import pairwise

import numpy as np

from chefbotd.components.calibration.algorithms.imu_mount import (
    LAGS_S,
    LEAST_READINGS,
    Flags,
    in_time,
    mount_of,
)
from chefbotd.components.calibration.algorithms.least_squares import Floats, solve
from chefbotd.components.calibration.algorithms.rolling import Rolling, rests, rolling
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Estimate,
    Measurements,
    Plot,
    Residual,
    Series,
    Status,
    StepResult,
)
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL
from chefbotd.core.poses import row_of
from chefbotd.core.record import Record, replace
from chefbotd.sensing.imu import ImuParameters

NAME = "imu"
LEAST_TURN_RAD, LEAST_REST_S = 12.0, 5.0
STILL_RAD_S = 0.02
"""Rates at rest vary by less."""

SAME_BIAS_RAD_S = 0.005
LEAST_PART_S = 0.25
LEAST_LAG_SIGMA_S = 1e-3
MOST_OFF, MOST_LEFT_RAD = 0.25, 0.08
LEAST_SHARE = 0.25
"""Of the readings, how many must be of a board that was not silent."""

WHEEL_SHARE, LIDAR_SHARE, SUM_SHARE = 1e-3, 3e-4, 1e-3
"""What the turn by calibrated wheels, that by a lidar, and the sum of 20 rates a second may be off; assumed."""

SLIP_RAD2_PER_RAD = 2.5e-5
"""How the turn by wheels scatters in the OptiOdom recordings."""


class ImuTurn(Record, frozen=True):
    """What an IMU shows: times (n,), and the unwrapped heading or the sum of its rates (n,)."""

    stamp_s: Floats
    shown_rad: Floats
    is_rate: bool


def fit_imu(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    """Scale, lag, and of a board that sends rates the bias and the mount."""
    imu, rolled = robot.imu or ImuParameters(), rolling(robot.chassis, measurements.wheels)
    shown = turned_by_imu(measurements)
    if rolled is None or shown is None:
        return _fail(
            Status.NOT_ENOUGH, "no readings of the wheels" if rolled is None else "too few of the IMU"
        )
    radius_m = max(wheel.radius_m for wheel in robot.chassis.wheels)
    spans = _find_unpowered(measurements, rests(rolled, radius_m))
    track_m = robot.chassis.effective_track_m
    heading_rad, by_lidar = _reference(robot, measurements, rolled)
    turned_rad = float(np.abs(np.diff(heading_rad)).sum())
    if turned_rad < LEAST_TURN_RAD:
        reason = f"the robot turned by {turned_rad:.1f} rad, of {LEAST_TURN_RAD:g} at least, on {track_m:g} m of track"
        return _fail(Status.NOT_ENOUGH, reason)
    used = in_time(shown.stamp_s, rolled.stamp_s)
    if used.mean() < LEAST_SHARE or used.sum() < LEAST_READINGS:
        return _fail(Status.NOT_ENOUGH, f"{used.sum()} readings of a board that was not silent just before")
    bias = _bias(shown, spans) if shown.is_rate else None
    if isinstance(bias, StepResult):
        return bias
    reference = rolled.stamp_s, heading_rad
    fitted = _fit_scale_and_lag(shown, used, reference, 0.0 if bias is None else bias[0], imu.lag_s)
    result = _judge_fit(robot, fitted, bias, turned_rad, by_lidar=by_lidar)
    mount = mount_of(imu, rolled, measurements.imu, fitted.lag_s[0])
    if result.status is not Status.PASSED or mount is None:
        return result
    return replace(result, estimates=(*result.estimates, mount))


def turned_by_imu(measurements: Measurements) -> ImuTurn | None:
    """The sum of the rates where there are any, else the unwrapped headings; None where there are too few of both."""
    rates = [(m.stamp_s, m.angular_velocity_rad_s[2]) for m in measurements.imu if m.angular_velocity_rad_s]
    headings = [(m.stamp_s, m.heading_rad) for m in measurements.imu if m.heading_rad is not None]
    chosen = np.array(rates or headings)
    if len(chosen) < LEAST_READINGS:
        return None
    chosen = chosen[np.concatenate([[True], np.diff(chosen[:, 0]) > 0])]
    stamp_s, values = chosen[:, 0], chosen[:, 1]
    if not rates:
        return ImuTurn(stamp_s, np.unwrap(values), is_rate=False)
    steps = (values[1:] + values[:-1]) / 2 * np.diff(stamp_s)
    return ImuTurn(stamp_s, np.concatenate([[0.0], np.cumsum(steps)]), is_rate=True)


def _find_unpowered(
    measurements: Measurements, spans: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """The parts of the spans in which no motor had duty."""
    powered = [one.stamp_s for one in measurements.driven if any(one.duty)]
    parts = []
    for begin_s, end_s in spans:
        limits = [begin_s, *[at_s for at_s in powered if begin_s <= at_s <= end_s], end_s]
        parts += [(a, b) for a, b in pairwise(limits) if b - a >= LEAST_PART_S]
    return parts


def _bias(shown: ImuTurn, spans: list[tuple[float, float]]) -> tuple[float, float] | StepResult:
    """The mean rate at rest and its standard deviation, or why there is none."""
    means, lengths, spread = [], [], []
    for begin_s, end_s in spans:
        inside = (shown.stamp_s >= begin_s) & (shown.stamp_s <= end_s)
        if inside.sum() < 4:
            continue
        stamp_s, total_rad = shown.stamp_s[inside], shown.shown_rad[inside]
        rates = np.diff(total_rad) / np.diff(stamp_s)
        if rates.std() > STILL_RAD_S:
            continue
        means.append((total_rad[-1] - total_rad[0]) / (stamp_s[-1] - stamp_s[0]))
        lengths.append(stamp_s[-1] - stamp_s[0])
        spread.append(rates.std() * math.sqrt(2 / len(rates)))  # each is the mean of two samples
    rested_s = sum(lengths)
    if rested_s < LEAST_REST_S:
        reason = (
            f"the robot rested for {rested_s:.1f} s of {LEAST_REST_S:g}: its wheels, its motors and its rates"
        )
        return _fail(Status.NOT_ENOUGH, reason)
    bias = float(np.average(means, weights=lengths))
    if max(abs(mean - bias) for mean in means) > SAME_BIAS_RAD_S:
        reason = "the rate at rest is not the same twice: something turned the robot while its wheels stood"
        return _fail(Status.REFUSED, reason)
    return bias, max(float(np.average(spread, weights=lengths)), 1e-5)


def _reference(robot: ConfiguredRobot, measurements: Measurements, rolled: Rolling) -> tuple[Floats, bool]:
    """The heading at each reading of the wheels, and whether a lidar has put it right."""
    track_m = robot.chassis.effective_track_m
    heading = (rolled.right_m - rolled.left_m) / track_m
    heading = heading - heading[0]
    lidar = next((one for one in robot.lidars if any(s.lidar == one.name for s in measurements.scans)), None)
    if lidar is None:
        return heading, False
    from chefbotd.components.calibration.algorithms.wheel_views import (
        lidar_view,  # matches scans, so it loads a compiler
    )

    scans = [one for one in measurements.scans if one.lidar == lidar.name]
    radius_m = max(wheel.radius_m for wheel in robot.chassis.wheels)
    view = lidar_view(rolled, track_m, radius_m, lidar.band_m, scans, NOMINAL, row_of(lidar.base_from_lidar))
    if view is None or not view.is_stop_and_go or view.share < 0.9:
        return heading, False
    in_order = np.argsort(view.drive.first)
    first, last, turns = view.drive.first[in_order], view.drive.last[in_order], view.drive.motion[in_order, 2]
    rows, off_rad = [int(first[0])], [0.0]
    for begin, end, seen_rad in zip(first.tolist(), last.tolist(), turns.tolist(), strict=True):
        by_wheels_rad = heading[end] - heading[begin]
        rows.append(end)
        off_rad.append(off_rad[-1] + math.remainder(seen_rad - by_wheels_rad, math.tau))
    turned = rolled.totals(track_m)[:, 1]
    return heading + np.interp(turned, turned[rows], off_rad), True


class FittedImu(Record, frozen=True):
    """The scale and the lag with their standard deviations, and what is left (n,) before and after, at times (n,)."""

    scale: tuple[float, float]
    lag_s: tuple[float, float]
    since_s: Floats
    before_rad: Floats
    after_rad: Floats
    is_determined: bool


def _fit_scale_and_lag(
    shown: ImuTurn, used: Flags, reference: tuple[Floats, Floats], bias: float, lag_s: float
) -> FittedImu:
    """Scale and lag, and of headings the drift; the bias of rates is what it was at rest.

    The offset is free. The sum of rates has another one after each time in which they were late.
    """
    stamp_s = shown.stamp_s[used]
    piece = (
        np.cumsum(np.diff(used.astype(int), prepend=0) == 1)[used] - 1
        if shown.is_rate
        else np.zeros(used.sum(), int)
    )
    counts = np.bincount(piece)

    def centred(values: Floats) -> Floats:
        return np.asarray(values - (np.bincount(piece, values) / counts)[piece])

    since_s = stamp_s - stamp_s[0]
    shown_rad = centred(shown.shown_rad[used] - bias * since_s)
    drifting = np.zeros_like(since_s) if shown.is_rate else centred(since_s / since_s[-1])

    def at(lag_s: float) -> Floats:
        return centred(np.interp(stamp_s - lag_s, *reference))

    def linear(lag_s: float) -> tuple[Floats, float]:
        columns = np.stack([at(lag_s), drifting], axis=1)
        values, *_ = np.linalg.lstsq(columns, shown_rad, rcond=None)
        return values, float(np.median(np.abs(shown_rad - columns @ values)))

    best_s = float(min(LAGS_S, key=lambda tried_s: linear(tried_s)[1]))
    values, left_rad = linear(best_s)
    noise_rad = max(1.5 * left_rad, 1e-4)
    start = np.array([values[0], best_s, values[1]])[: 2 if shown.is_rate else 3]

    def residuals(p: Floats) -> Floats:
        drift = 0.0 if shown.is_rate else p[2] * drifting
        left: Floats = (shown_rad - p[0] * at(float(p[1])) - drift) / noise_rad
        return left[:, None]

    solution = solve(residuals, start)
    return FittedImu(
        (float(solution.values[0]), float(solution.sigmas[0])),
        (float(solution.values[1]), float(solution.sigmas[1])),
        since_s,
        centred(shown.shown_rad[used]) - at(lag_s),
        solution.residuals[:, 0] * noise_rad,
        solution.is_determined,
    )


def _judge_fit(
    robot: ConfiguredRobot,
    fitted: FittedImu,
    bias: tuple[float, float] | None,
    turned_rad: float,
    *,
    by_lidar: bool,
) -> StepResult:
    """The result, unless wheels and IMU do not speak of the same drive. ``bias`` None: a board that sends headings."""
    imu, scale, rms_rad = robot.imu or ImuParameters(), fitted.scale[0], _rms(fitted.after_rad)
    if scale < 0:
        reason = "the IMU turns the other way than the wheels: a sign, or the sides, are wrong"
        return _fail(Status.REFUSED, reason)
    if abs(scale - 1) > MOST_OFF or rms_rad > MOST_LEFT_RAD or not fitted.is_determined:
        reason = f"the IMU shows {scale:.2f} of the turns by the wheels, and {rms_rad:.3f} rad are left"
        return _fail(Status.REFUSED, f"{reason}: are the wheels calibrated?")
    doubt = LIDAR_SHARE if by_lidar else math.hypot(WHEEL_SHARE, math.sqrt(SLIP_RAD2_PER_RAD / turned_rad))
    old_scale = 1.0 if bias is None else imu.gyro_scale
    sigma = math.hypot(fitted.scale[1], doubt, 0.0 if bias is None else SUM_SHARE)
    estimates = [
        Estimate("imu.gyro_scale", "", imu.gyro_scale, old_scale * scale, sigma),
        Estimate("imu.lag_s", "s", imu.lag_s, fitted.lag_s[0], max(fitted.lag_s[1], LEAST_LAG_SIGMA_S)),
    ]
    estimates += robot.left_uncertain({"gyro_scale_sigma": sigma / scale})
    if bias is not None:
        after = imu.gyro_bias_rad_s + imu.gyro_scale * bias[0]
        estimates.append(Estimate("imu.gyro_bias_rad_s", "rad/s", imu.gyro_bias_rad_s, after, bias[1]))
    before_rad, since_s = fitted.before_rad, tuple(fitted.since_s.tolist())
    residual = Residual("turn by the IMU", "rad", _rms(before_rad), rms_rad, len(since_s))
    series = (
        Series("before", since_s, tuple(before_rad.tolist())),
        Series("after", since_s, tuple(fitted.after_rad.tolist())),
    )
    plot = Plot("The IMU's turn less that of the reference", "time (s)", "difference (rad)", series)
    reason = "" if by_lidar else "held against the wheels: a lidar would tell more"
    return StepResult(NAME, Status.PASSED, reason, tuple(estimates), (residual,), (plot,))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _fail(status: Status, reason: str) -> StepResult:
    return StepResult(NAME, status, reason)
