"""Checks of a lidar's link, and of its mount, by what moved in its scans.

Three tests show the mount: something is placed ahead of the robot; the robot drives forward, and the walls ahead come
nearer; it turns to the left, and the room turns to the right.
"""

import math

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import Record

Array = NDArray[np.float64]

STEP_RAD = math.radians(5)
MOST_POINTS = 180
FAR_M = 0.3
"""The cost of a point without a neighbour, as a distance: parts of a room are hidden in one of the scans."""

WRONG_RAD = math.radians(20)
BETTER_SHARE = 0.75
"""Another direction is believed if it leaves at most this share of the distance between the scans."""

LEAST_MOVED_M, LEAST_TURNED_RAD = 0.1, 0.3
APPEARED_M = 0.25
NEAREST_M, FARTHEST_M = 0.2, 0.9
LEAST_BEAMS = 5


class ScanTaken(Record, frozen=True):
    """A whole turn, its bearings as the lidar has them (CCW from its zero mark); the mount is the configured one."""

    base_from_lidar: Pose2D
    bearing_rad: tuple[float, ...]
    range_m: tuple[float, ...]

    def points(self, offset_rad: float = 0.0, *, mirrored: bool = False) -> Array:
        """The ends of the beams in the base frame, if the mount were turned left by this angle, or upside down."""
        bearing, distance = np.array(self.bearing_rad), np.array(self.range_m)
        seen = distance > 0
        bearing, distance = bearing[seen], distance[seen]
        yaw = self.base_from_lidar.heading_rad + offset_rad + (-bearing if mirrored else bearing)
        mount = np.array([self.base_from_lidar.x_m, self.base_from_lidar.y_m])
        ends: Array = mount + distance[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        return ends


class ScanFit(Record, frozen=True):
    """The mean distance between two scans, for the configured mount and for the best one."""

    configured_m: float
    best_m: float
    offset_rad: float
    mirrored: bool


def fit_motion(before: ScanTaken, after: ScanTaken, before_from_after: Pose2D) -> ScanFit:
    """The mount with which the second scan, moved back, lies on the first.

    A drive tells the direction and cannot tell a mirrored one; a turn on the spot the other way round.
    """
    if abs(before_from_after.heading_rad) >= LEAST_TURNED_RAD:
        candidates = [(0.0, False), (0.0, True)]
    else:
        candidates = [(wrap_angle(step * STEP_RAD), False) for step in range(round(math.tau / STEP_RAD))]
    apart = {candidate: _apart_m(before, after, before_from_after, *candidate) for candidate in candidates}
    best = min(apart, key=lambda candidate: apart[candidate])
    return ScanFit(apart[0.0, False], apart[best], *best)


def _apart_m(before: ScanTaken, after: ScanTaken, motion: Pose2D, offset_rad: float, mirrored: bool) -> float:
    old = _thin_points(before.points(offset_rad, mirrored=mirrored))
    new = _thin_points(after.points(offset_rad, mirrored=mirrored))
    if not len(old) or not len(new):
        return FAR_M
    cos, sin = math.cos(motion.heading_rad), math.sin(motion.heading_rad)
    moved = new @ np.array([[cos, sin], [-sin, cos]]) + np.array([motion.x_m, motion.y_m])
    nearest = np.sqrt(((moved[:, None, :] - old[None, :, :]) ** 2).sum(axis=2).min(axis=1))
    return float(np.minimum(nearest, FAR_M).mean())


def _thin_points(points: Array) -> Array:
    thinned: Array = points[:: max(1, math.ceil(len(points) / MOST_POINTS))]
    return thinned


def check_motion(name: str, before: ScanTaken, after: ScanTaken, motion: Pose2D) -> Finding:
    """Whether the scans moved as odometry did."""
    turned = abs(motion.heading_rad) >= LEAST_TURNED_RAD
    check = f"lidar_turn {name}" if turned else f"lidar_forward {name}"
    if not turned and math.hypot(motion.x_m, motion.y_m) < LEAST_MOVED_M:
        return skip_check(check, "odometry hardly moved, so the scans cannot be compared with it")
    fit = fit_motion(before, after, motion)
    text = f"moved back by odometry, its scans lie {fit.configured_m * 100:.1f} cm apart"
    better = fit.best_m < BETTER_SHARE * fit.configured_m
    if better and fit.mirrored:
        return problem(
            check,
            f"{text}, mirrored only {fit.best_m * 100:.1f} cm: it spins in the opposite direction",
            "invert upside_down for this [[lidar]] (or the encoders' sides are exchanged: see 'turn')",
        )
    if better and abs(fit.offset_rad) > WRONG_RAD:
        yaw_rad = wrap_angle(before.base_from_lidar.heading_rad + fit.offset_rad)
        return problem(
            check,
            f"{text}, turned by {math.degrees(fit.offset_rad):+.0f}° "
            f"only {fit.best_m * 100:.1f} cm: its mount_yaw_rad is wrong",
            f"set mount_yaw_rad = {yaw_rad:.2f} for this [[lidar]]",
        )
    if fit.configured_m >= FAR_M / 2:
        return warning(check, f"{text}, and no other mount is better", "did the robot move as it was asked?")
    return ok(check, text)


def check_ahead(name: str, before: ScanTaken, after: ScanTaken, ahead_m: float) -> Finding:
    """Whether what was placed ahead of the robot appeared ahead of it."""
    check = f"lidar_ahead {name}"
    bearing_rad = _appeared_at_rad(before, after)
    if bearing_rad is None:
        return warning(
            check,
            "nothing new was seen",
            f"place something as high as the lidar and as wide as a hand {ahead_m:g} m ahead, and look again",
        )
    text = f"the object placed ahead appears at {math.degrees(bearing_rad):+.0f}° (0° is ahead, + is left)"
    if abs(bearing_rad) <= WRONG_RAD:
        return ok(check, text)
    yaw_rad = wrap_angle(before.base_from_lidar.heading_rad - bearing_rad)
    return problem(
        check,
        f"{text}: the configured mount of the lidar is wrong",
        f"set mount_yaw_rad = {yaw_rad:.2f} for this [[lidar]]"
        + (", it is mounted the wrong way round" if abs(bearing_rad) > math.pi - WRONG_RAD else ""),
    )


def _appeared_at_rad(before: ScanTaken, after: ScanTaken) -> float | None:
    """The direction from the base in which beams became shorter; None where too few did."""
    new, old = after.points(), before.points()
    if not len(new) or not len(old):
        return None
    bearing, old_bearing = (np.arctan2(points[:, 1], points[:, 0]) for points in (new, old))
    distance, old_distance = (np.hypot(points[:, 0], points[:, 1]) for points in (new, old))
    apart = np.abs(np.angle(np.exp(1j * (bearing[:, None] - old_bearing[None, :]))))
    shorter = old_distance[apart.argmin(axis=1)] - distance > APPEARED_M
    shorter &= (distance > NEAREST_M) & (distance < FARTHEST_M)  # somebody walks about, farther off
    if shorter.sum() < LEAST_BEAMS:
        return None
    return float(np.angle(np.exp(1j * bearing[shorter]).mean()))


ADVICE = {
    "wrong_baud": "set its baud in [[lidar]]: 'chefbotctl ports --listen' finds the rate",
    "wrong_device": "set its device and model in [[lidar]]: 'chefbotctl ports --listen' names what is behind each port",
    "motor_stalled": "does its motor turn, and has it 5 V? A weak USB port cannot start it",
    "frozen": "switch its power off and on",
}
"""What to do about each condition; about any other, look at power and plug."""


def check_lidar(name: str, condition: str, reason: str, scans_hz: float, covered: float) -> Finding:
    """A lidar's link and its scans; ``covered`` is the share of beams that measured something."""
    check = f"lidar {name}"
    if condition != "healthy":
        return problem(
            check,
            f"{name} is {condition.replace('_', ' ')}" + (f": {reason}" if reason else ""),
            ADVICE.get(condition, "check its power and its plug; 'chefbotctl ports --listen' finds its port"),
        )
    text = f"{name} sends {scans_hz:.1f} turns a second, {covered:.0%} of its beams measure"
    if not scans_hz:
        return problem(check, text, "does its motor turn?")
    if covered < 0.3:
        return warning(
            check, text, "is something before it, or its window dirty? In a hall much is out of reach"
        )
    return ok(check, text)
