"""The result of the step ``wheels``: fitted to what a lidar or the truth saw, and judged before it may be believed."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.rolling import Rolling, rolling
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
from chefbotd.components.calibration.algorithms.wheel_fit import (
    RecordedDrive,
    WheelFit,
    difference,
    fit,
    without_play,
)
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel
from chefbotd.components.calibration.algorithms.wheel_signs import signs, wrong_sides
from chefbotd.components.calibration.algorithms.wheel_views import LidarView, lidar_view, truth_view
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.poses import row_of
from chefbotd.core.record import replace
from chefbotd.sensing.lidar import LidarParameters

NAME = "wheels"
LEAST_TURN_RAD, LEAST_TRAVEL_M = 6.0, 1.5
LEAST_MATCHED = 0.7
SURE = {"radius": 0.005, "track": 0.005, "ratio": 0.003}
"""The largest standard deviations that are a result."""

SCALE_SIGMA, OFFSET_SCALE_SIGMA = 1e-3, 3e-4
"""What a lidar that reads up to 1 cm too far makes of all lengths, and what is left of that where the walls show by how
much it does: measured on 20 simulated robots in a flat."""

TOLD_OFFSET_M = 2e-3
"""A range error that is worth a remark."""

SURE_M, SURE_RAD = 0.005, 0.01
"""The same of a lidar's mount."""

NEEDS = {"radius": "straights", "track": "turns on the spot", "ratio": "curves or straights both ways"}
"""What determines each of them."""

MOST_OFF = 0.2
MOST_LEFT_RAD = 0.15
"""Wheels and lidar that differ by so much in a motion do not speak of the same drive."""

LEFT, RIGHT, TRACK = np.eye(7)[:3]


def fit_wheels(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    """Radii, track and mount by the scans of the first lidar that has any, or else radii and track by the truth."""
    rolled = rolling(robot.chassis, measurements.wheels)
    if rolled is None:
        return _not_enough("no readings of the wheels")
    lidar = next((one for one in robot.lidars if any(s.lidar == one.name for s in measurements.scans)), None)
    if lidar is not None:
        return _by_lidar(robot, measurements, rolled, lidar)
    drive = truth_view(rolled, measurements.truth)
    if drive is None:
        return _not_enough("no scans of a lidar, and no truth, beside the wheels")
    missing = _too_little(robot, rolled)
    if missing:
        return _not_enough(missing)
    return _judge_fit(robot, drive, fit(robot.chassis.effective_track_m, [drive]), None)


def _by_lidar(
    robot: ConfiguredRobot, measurements: Measurements, rolled: Rolling, lidar: LidarParameters
) -> StepResult:
    missing = _too_little(robot, rolled)
    if missing:
        return _not_enough(missing)
    scans = [one for one in measurements.scans if one.lidar == lidar.name]
    model, mount = NOMINAL, row_of(lidar.base_from_lidar)
    seen = lidar_seen(robot, rolled, lidar, scans, model, mount)
    if (
        isinstance(seen, LidarView) and not seen.is_stop_and_go
    ):  # scans in motion are corrected by what is fitted
        result = fit(robot.chassis.effective_track_m, [seen.drive], mount=mount)
        if result.is_determined:
            seen = lidar_seen(robot, rolled, lidar, scans, result.model, result.mount)
    if isinstance(seen, StepResult):
        return seen
    result = fit(robot.chassis.effective_track_m, [seen.drive], mount=mount, has_play=True)
    sigma = SCALE_SIGMA if seen.range_offset_m is None else OFFSET_SCALE_SIGMA
    result = replace(result, covariance=_with_scale(result.covariance, sigma))
    judged = _judge_fit(robot, seen.drive, result, lidar)
    return replace(judged, reason=judged.reason or _remark(lidar, seen.range_offset_m))


def _with_scale(covariance: Floats, sigma: float) -> Floats:
    """The covariance with what the lidar's own error adds: to the radii and the track alike, not to their ratios."""
    more = covariance.copy()
    more[:3, :3] += sigma**2
    return more


def _remark(lidar: LidarParameters, offset_m: float | None) -> str:
    if offset_m is None or abs(offset_m) < TOLD_OFFSET_M:
        return ""
    side = "far" if offset_m > 0 else "near"
    return f"{lidar.name} reads {1e3 * abs(offset_m):.0f} mm too {side}, which is taken into account"


def fit_mount(robot: ConfiguredRobot, measurements: Measurements, lidar: LidarParameters) -> StepResult:
    """The lidar's mount by its scans, if radii and track are as configured."""
    rolled = rolling(robot.chassis, measurements.wheels)
    if rolled is None:
        return _not_enough("no readings of the wheels")
    too_little = _too_little(robot, rolled)
    if too_little:
        return _not_enough(too_little)
    scans = [one for one in measurements.scans if one.lidar == lidar.name]
    track_m, mount = robot.chassis.effective_track_m, row_of(lidar.base_from_lidar)
    seen = lidar_seen(robot, rolled, lidar, scans, NOMINAL, mount)
    if isinstance(seen, StepResult):
        return seen
    result = fit(track_m, [seen.drive], mount=mount, knows_wheels=True)
    sigma_m, sigma_rad = max(result.sigmas[4:6].tolist()), float(result.sigmas[6])
    if not (result.is_determined and sigma_m < SURE_M and sigma_rad < SURE_RAD):
        return _not_enough(f"{lidar.name}: turns for its place, and straights for its direction")
    before, after = (difference(track_m, NOMINAL, seen.drive, one) for one in (mount, result.mount))
    estimates = tuple(mount_estimates(lidar, result))
    return StepResult(NAME, Status.PASSED, "", estimates, residuals(before, after), plots(before, after))


def lidar_seen(
    robot: ConfiguredRobot,
    rolled: Rolling,
    lidar: LidarParameters,
    scans: Sequence[ScanMeasured],
    model: WheelModel,
    mount: Floats,
) -> LidarView | StepResult:
    """What the lidar saw, or why that is nothing to fit to."""
    track_m = robot.chassis.effective_track_m
    radius_m = max(wheel.radius_m for wheel in robot.chassis.wheels)
    view = lidar_view(rolled, track_m, radius_m, lidar.band_m, scans, model, mount)
    if view is None:
        return _not_enough(f"{lidar.name} saw too little, or from too few places")
    wrong = _wrong(track_m, view, lidar)
    if wrong:
        return _refuse(wrong)
    if view.share < LEAST_MATCHED:
        lost = round(100 * (1 - view.share))
        return _refuse(
            f"{lost} % of the scans do not fit to those before, from where the wheels say they are"
        )
    return view


def _wrong(track_m: float, view: LidarView, lidar: LidarParameters) -> str:
    seen = signs(track_m, view.drive)
    return "" if seen is None else wrong_sides(seen, lidar.mount_yaw_rad)


def _too_little(robot: ConfiguredRobot, rolled: Rolling) -> str:
    travel_m, turned_rad = rolled.totals(robot.chassis.effective_track_m)[-1].tolist()
    if turned_rad < LEAST_TURN_RAD:
        return f"turns: {turned_rad:.1f} rad in all, at least {LEAST_TURN_RAD:g} rad are needed for the track"
    if travel_m < LEAST_TRAVEL_M:
        return f"travel: {travel_m:.2f} m in all, at least {LEAST_TRAVEL_M:g} m are needed for the radii"
    return ""


def _judge_fit(
    robot: ConfiguredRobot, drive: RecordedDrive, result: WheelFit, lidar: LidarParameters | None
) -> StepResult:
    """The result, if it may be believed."""
    model = result.model
    sigmas = {
        "radius": result.deviation((LEFT + RIGHT) / 2),
        "track": result.deviation(TRACK),
        "ratio": result.deviation(LEFT - RIGHT),
    }
    unsure = [name for name, most in SURE.items() if not sigmas[name] <= most]
    if not result.is_determined or unsure:
        need = {
            "radius": "straights and wide curves",
            "track": "turns",
            "ratio": "straights and turns both ways",
        }
        return _not_enough(
            f"{' and '.join(need[name] for name in unsure or need)} to determine {', '.join(unsure or need)}"
        )
    track_m = robot.chassis.effective_track_m
    rolled = without_play(drive, result.play_m)
    after = difference(track_m, model, rolled, None if lidar is None else result.mount)
    left_rad = float(np.median(np.abs(after[:, 2])))
    if left_rad > MOST_LEFT_RAD:
        return _refuse(f"wheels and what was seen differ by {left_rad:.2f} rad in half of the motions")
    if max(abs(value - 1) for value in (model.left, model.right, model.track)) > MOST_OFF:
        return _refuse(
            f"radii {model.left:.3f} and {model.right:.3f} and track {model.track:.3f} times the configured ones: "
            "check the configured sizes and the counts of a wheel turn first"
        )
    before = difference(track_m, NOMINAL, drive, None if lidar is None else row_of(lidar.base_from_lidar))
    return StepResult(
        NAME,
        Status.PASSED,
        estimates=tuple(_estimates(robot, result, lidar)),
        residuals=residuals(before, after),
        plots=plots(before, after),
    )


def _estimates(robot: ConfiguredRobot, result: WheelFit, lidar: LidarParameters | None) -> Iterator[Estimate]:
    chassis, model, sigmas = robot.chassis, result.model, result.sigmas
    factors = (
        ("left_radius_multiplier", chassis.left_radius_multiplier, model.left),
        ("right_radius_multiplier", chassis.right_radius_multiplier, model.right),
        ("track_multiplier", chassis.track_multiplier, model.track),
    )
    for (key, before, factor), sigma in zip(factors, sigmas[:3].tolist(), strict=True):
        yield Estimate(f"chassis.{key}", "", before, before * factor, before * sigma)
    if lidar is not None:
        yield from mount_estimates(lidar, result)
    size = (LEFT + RIGHT) / 2
    yield from robot.left_uncertain(
        {
            "size_sigma": result.deviation(size),
            "ratio_sigma": result.deviation(LEFT - RIGHT),
            "track_sigma": result.deviation(size - TRACK),  # of a turn, which takes both
        }
    )


def mount_estimates(lidar: LidarParameters, result: WheelFit) -> Iterator[Estimate]:
    """The lidar's x, y and yaw."""
    mount = (("x_m", lidar.mount_x_m), ("y_m", lidar.mount_y_m), ("yaw_rad", lidar.mount_yaw_rad))
    sigmas = result.sigmas[4:].tolist()
    for (key, value), new, sigma in zip(mount, result.mount.tolist(), sigmas, strict=True):
        unit = key.rpartition("_")[2]
        yield Estimate(f"lidar.{lidar.name}.mount_{key}", unit, value, new, sigma)


def residuals(before: Floats, after: Floats) -> tuple[Residual, ...]:
    """How far off motions (n, 3) are, in place and heading."""

    def rms(off: Floats) -> float:
        return math.sqrt(float((off**2).mean()))

    return (
        Residual("place after a motion", "m", rms(before[:, :2]), rms(after[:, :2]), len(after)),
        Residual("heading after a motion", "rad", rms(before[:, 2]), rms(after[:, 2]), len(after)),
    )


def plots(before: Floats, after: Floats) -> tuple[Plot, ...]:
    """How far off motions (n, 3) are, one point each."""
    number = tuple(float(k) for k in range(len(after)))
    places = tuple(
        Series(name, tuple((1e3 * off[:, 0]).tolist()), tuple((1e3 * off[:, 1]).tolist()), points=True)
        for name, off in (("before", before), ("after", after))
    )
    headings = tuple(
        Series(name, number, tuple(np.degrees(off[:, 2]).tolist()), points=True)
        for name, off in (("before", before), ("after", after))
    )
    return (
        Plot("How far off each motion ends", "x (mm)", "y (mm)", places, equal=True),
        Plot("How far off each motion turns", "motion", "heading (deg)", headings),
    )


def _not_enough(reason: str) -> StepResult:
    return StepResult(NAME, Status.NOT_ENOUGH, reason)


def _refuse(reason: str) -> StepResult:
    return StepResult(NAME, Status.REFUSED, reason)
