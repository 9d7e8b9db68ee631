"""The step ``sensors``: by how much ultrasonic and infrared sensors read too far, against a lidar.

The robot turns in steps. Wherever it stands, the nearest point that the lidar sees in a sensor's cone is what the sensor
should read.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.rolling import rests, rolling
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Estimate,
    Measurements,
    Move,
    Plot,
    Procedure,
    Residual,
    Series,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.poses import row_of
from chefbotd.core.record import Record
from chefbotd.perception.laser_scan import place_points, seen_from, usable

NAME = "sensors"
HEADINGS = 12
TURN_RAD_S, LOOK_S = 0.8, 1.0
LEAST_STOPS = 4
DIRECTIONS = 15
AHEAD_RAD, LINE_RAD, LINE_M, LEAST_POINTS = math.radians(1.0), math.radians(4.0), 0.03, 12
"""A surface is looked for so far to either side of a direction; its points are so near to a line, and so many."""

NEAR_M, FAR_M = 0.25, 2.0
"""Where the lidar sees well what the sensor sees: nearer, heights differ; farther, a cone is wide."""

MOST_M = 0.3
AGREE_M = 0.03
"""Readings that differ from the usual offset by more are of something else, such as a table that the lidar misses."""

LEAST_SIGMA_M = 5e-3
"""The lidar's own range error (up to a centimetre, assumed) is in the offset, however well the readings agree."""


class _Sensor(Record, frozen=True):
    """A sensor by its configuration: the path of its key, and what the fit needs."""

    key: str
    name: str
    offset_m: float
    base_from_sensor: Pose2D
    field_of_view_rad: float


class _Pair(Record, frozen=True):
    """What a sensor read at a stop in the mean, and what the lidar says, both in metres."""

    read_m: float
    expected_m: float


def _sensors(robot: ConfiguredRobot) -> Iterator[_Sensor]:
    if robot.ultrasonic is not None:
        one = robot.ultrasonic
        yield _Sensor("ultrasonic", one.name, one.offset_m, one.base_from_sensor, one.field_of_view_rad)
    for infrared in robot.infrared:
        yield _Sensor(
            f"infrared.{infrared.name}",
            infrared.name,
            infrared.offset_m,
            infrared.base_from_sensor,
            infrared.field_of_view_rad,
        )


def _missing(robot: ConfiguredRobot) -> str:
    if not any(True for _ in _sensors(robot)):
        return "the robot has no ultrasonic or infrared sensor"
    return "" if robot.lidars else "the robot has no lidar"


def _procedure(robot: ConfiguredRobot) -> Procedure:
    seconds = math.tau / HEADINGS / TURN_RAD_S
    for heading in range(HEADINGS):
        yield Move(None, LOOK_S, "looks ahead", heading / HEADINGS)
        yield Move(Twist2D(0.0, TURN_RAD_S), seconds, "turns a little", (heading + 0.5) / HEADINGS)


def _fit(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    rolled = rolling(robot.chassis, measurements.wheels)
    if rolled is None:
        return StepResult(NAME, Status.NOT_ENOUGH, "no readings of the wheels")
    spans = rests(rolled, max(wheel.radius_m for wheel in robot.chassis.wheels))
    results = [_of_sensor(sensor, robot, measurements, spans) for sensor in _sensors(robot)]
    passed = [result for result in results if result.status is Status.PASSED]
    reason = "; ".join(result.reason for result in results if result.reason)
    if not passed:
        status = Status.REFUSED if any(r.status is Status.REFUSED for r in results) else Status.NOT_ENOUGH
        return StepResult(NAME, status, reason)
    return StepResult(
        NAME,
        Status.PASSED,
        reason,
        tuple(estimate for result in passed for estimate in result.estimates),
        tuple(residual for result in passed for residual in result.residuals),
        tuple(plot for result in passed for plot in result.plots),
    )


def _of_sensor(
    sensor: _Sensor, robot: ConfiguredRobot, measurements: Measurements, spans: Sequence[tuple[float, float]]
) -> StepResult:
    ranges = [
        one for one in measurements.ranges if one.sensor == sensor.name and one.status is RangeStatus.OK
    ]
    pairs = [pair for span in spans if (pair := _pair(sensor, robot, measurements.scans, ranges, span))]
    off_m = np.array([pair.read_m - pair.expected_m for pair in pairs])
    agree = np.abs(off_m - np.median(off_m)) < AGREE_M if len(off_m) else np.zeros(0, bool)
    if agree.sum() < LEAST_STOPS:
        reason = (
            f"{sensor.name}: {agree.sum()} of {LEAST_STOPS} places at which lidar and sensor see the same"
        )
        return StepResult(NAME, Status.NOT_ENOUGH, f"{reason} {NEAR_M:g} to {FAR_M:g} m ahead")
    usual_m, spread_m = float(off_m[agree].mean()), float(off_m[agree].std(ddof=1))
    if abs(usual_m) > MOST_M or agree.sum() < len(off_m) / 2:
        reason = f"{sensor.name} and the lidar differ by {usual_m:.2f} m: is the mount of either right?"
        return StepResult(NAME, Status.REFUSED, reason)
    sigma_m = max(spread_m / math.sqrt(int(agree.sum())), LEAST_SIGMA_M)
    estimate = Estimate(f"{sensor.key}.offset_m", "m", sensor.offset_m, sensor.offset_m + usual_m, sigma_m)
    before = math.sqrt(float((off_m[agree] ** 2).mean()))
    residual = Residual(f"{sensor.name}: range", "m", before, spread_m, int(agree.sum()))
    return StepResult(
        NAME, Status.PASSED, "", (estimate,), (residual,), (_plot(sensor.name, pairs, usual_m),)
    )


def _pair(
    sensor: _Sensor,
    robot: ConfiguredRobot,
    scans: Iterable[ScanMeasured],
    ranges: Iterable[RangeMeasured],
    span: tuple[float, float],
) -> _Pair | None:
    begin_s, end_s = span
    read = [one.range_m for one in ranges if begin_s <= one.stamp_s <= end_s and one.range_m is not None]
    seen = [_points(robot, one) for one in scans if begin_s + 0.2 <= one.stamp_s <= end_s]
    if len(read) < 2 or not seen:
        return None
    expected_m = _nearest_m(sensor, np.concatenate(seen))
    if expected_m is None or not NEAR_M <= expected_m <= FAR_M:
        return None
    return _Pair(float(np.median(read) if np.ptp(read) > AGREE_M else np.mean(read)), expected_m)


def _points(robot: ConfiguredRobot, measured: ScanMeasured) -> Floats:
    """What a turn at rest shows, (n, 2) in the base's frame."""
    lidar = next((one for one in robot.lidars if one.name == measured.lidar), None)
    if lidar is None:
        return np.empty((0, 2))
    used = usable(lidar.band_m, measured.scan)
    bearing, ranges = measured.scan.bearing_rad[used], measured.scan.range_m[used]
    points = np.stack([ranges * np.cos(bearing), ranges * np.sin(bearing)], axis=1)
    return place_points(row_of(lidar.base_from_lidar), points)


def _nearest_m(sensor: _Sensor, points: Floats) -> float | None:
    """The distance of the nearest thing in the cone, by the surfaces in all directions of it."""
    seen = seen_from(row_of(sensor.base_from_sensor), points)
    bearing, ranges = np.arctan2(seen[:, 1], seen[:, 0]), np.hypot(seen[:, 0], seen[:, 1])
    half_rad = sensor.field_of_view_rad / 2
    directions = np.linspace(-half_rad, half_rad, DIRECTIONS)
    distances = [_surface_m(bearing - direction, ranges) for direction in directions.tolist()]
    return min((one for one in distances if one is not None), default=None)


def _surface_m(beside_rad: Floats, ranges: Floats) -> float | None:
    """How far the surface is straight ahead: on a line, the inverse of the range is nearly linear in the bearing.

    The nearest of many noisy readings is too near, and a line through them is not. Where there is none, it is the median
    straight ahead.
    """
    near, ahead = np.abs(beside_rad) <= LINE_RAD, np.abs(beside_rad) <= AHEAD_RAD
    if not ahead.any():
        return None
    if np.count_nonzero(near) >= LEAST_POINTS:
        slope, inverse = np.polyfit(beside_rad[near], 1 / ranges[near], 1).tolist()
        off_m = ranges[near] - 1 / (inverse + slope * beside_rad[near])
        if math.sqrt(float((off_m**2).mean())) < LINE_M:
            return float(1 / inverse)
    return float(np.median(ranges[ahead]))


def _plot(name: str, pairs: Sequence[_Pair], offset_m: float) -> Plot:
    expected = tuple(pair.expected_m for pair in pairs)
    read = Series("read", expected, tuple(pair.read_m for pair in pairs), points=True)
    line = Series("lidar and offset", expected, tuple(value + offset_m for value in expected))
    return Plot(f"{name} against the lidar", "lidar (m)", "sensor (m)", (read, line), equal=True)


SENSORS = StepDefinition(
    NAME,
    "the offset of ultrasonic and infrared sensors",
    "Put the robot where walls or boxes stand around it, 0.5 to 1.5 m away.",
    0.1,
    _missing,
    _procedure,
    _fit,
)
