"""The obstacle guard for scans: it moves the robot's outline ahead along the arc that it drives.

In the robot's frame every point that a lidar sees moves on a circle about the centre of the robot's turn. The robot
may be as fast as it can brake along the same arc before the first point touches its outline. Points that the outline
never touches slow nothing: a wall at the side, a table that is passed. What comes towards the robot, such as another
robot, is expected to come on as fast until the robot stands. Where the whole motion is not allowed, its allowed part
goes on: turning, or driving straight. A direction in which the robot was brought to a stand has the hysteresis of
``guard``.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import STANDING, Motion, Twist2D, WheelVelocities
from chefbotd.core.record import Record
from chefbotd.safety.guard import GuardParameters, release_distance_m
from chefbotd.safety.outline import Outline

Floats: TypeAlias = NDArray[np.float64]

OBSTACLE, SILENT = "obstacle:", "silent:"
"""What a motion is limited for; the lidar's name follows."""

STRAIGHT_RAD_S = 1e-6
"""Slower turning than this is driving straight."""

STANDING_M_S = 1e-6
"""A robot no part of which is faster than this stands."""

CREEPING_M_S = 0.01
"""No motion is begun, or left over, that is slower than this: a robot before a wall stands still."""

CLOSING_M_S = 1e-3
"""What comes closer more slowly than this does not come closer."""

WHOLE = 1 - 1e-9

NOISE_M = 0.03
"""What came closer by less in two turns may not have moved: the nearest of many readings shifts (LD19: 1 cm)."""

FASTEST_M_S = 2.0
"""Nothing is expected to come faster: what seems to was hidden before, or is faster than people walk."""

ROUNDING_M = 1e-6
"""The last bits of a sum do not decide whether something comes."""

STEADY = 1 / 8
"""What comes does at least so much of its way in each of two turns; what was only missed does all of it in one."""


class View(Record, frozen=True):
    """The recent points of a lidar: ``points_m`` (n, 2) in the robot's frame at its present pose.

    The newest was measured at ``stamp_s`` and received at ``arrival_s``; a turn of the lidar takes ``turn_s``.
    ``earlier`` works out, in the same frame, the points that a look one turn earlier had, and one ``before_s`` earlier,
    which is about two turns; None: too few turns are known.
    """

    lidar: str
    points_m: Floats
    stamp_s: float
    arrival_s: float
    turn_s: float
    earlier: tuple[Callable[[], Floats], Callable[[], Floats]] | None = None
    before_s: float = 0.0


NOT_SEEN: Floats = np.zeros((0, 2))
"""The points of a lidar that was never heard."""


def limit(
    params: GuardParameters,
    outline: Outline,
    views: Sequence[View],
    motion: Motion,
    now_s: float,
    blocked: Twist2D = STANDING,
) -> tuple[Motion, str | None]:
    """The motion that may be driven, and what it was limited for (None: it is ``motion``).

    The reason is ``obstacle:`` and the name of the lidar that sees it, or ``silent:`` and that of a lidar without a
    recent scan. ``blocked`` is what ``blocked_after`` the motion before says.
    """
    look = _Look(params, outline, views, now_s, blocked)
    twist = _twist(motion)
    share, limited_by = look.share_of(twist)
    if share >= WHOLE:
        return motion, None
    if share * look.rim_m_s(twist) < CREEPING_M_S:
        share = 0.0
    if isinstance(motion, WheelVelocities):
        return motion.slowed(share), limited_by
    if limited_by.startswith(SILENT):  # no part of it is free: it goes the same way, at a crawl
        return _scale_twist(motion, share), limited_by
    return look.most_of(motion, share), limited_by


def blocked_after(blocked: Twist2D, asked: Motion, allowed: Motion) -> Twist2D:
    """The directions in which the robot was brought to a stand: by its sign each axis that was asked for, and is zero.

    An axis that moves is free again, and one that nobody asked for stays as it was. So does the turning of an arc of
    which nothing is allowed: what is ahead of it may be no obstacle to turning on the spot.
    """
    was_asked, is_allowed = _twist(asked), _twist(allowed)
    linear = _axis_after(blocked.linear_m_s, was_asked.linear_m_s, is_allowed.linear_m_s)
    if was_asked.linear_m_s and is_allowed == STANDING:
        return Twist2D(linear, blocked.angular_rad_s)
    return Twist2D(
        linear, _axis_after(blocked.angular_rad_s, was_asked.angular_rad_s, is_allowed.angular_rad_s)
    )


def _axis_after(blocked: float, asked: float, allowed: float) -> float:
    if asked == 0:
        return blocked
    return 0.0 if allowed else math.copysign(1.0, asked)


def _twist(motion: Motion) -> Twist2D:
    return motion.twist if isinstance(motion, WheelVelocities) else motion


class _Look:
    """One look at what is around, for as many motions as are tried."""

    def __init__(
        self,
        params: GuardParameters,
        outline: Outline,
        views: Sequence[View],
        now_s: float,
        blocked: Twist2D,
    ) -> None:
        self._params, self._outline, self._blocked = params, outline, blocked
        self._heard = [view for view in views if now_s - view.arrival_s <= params.max_age_s]
        self._silent = [view.lidar for view in views if now_s - view.arrival_s > params.max_age_s]
        self._delays_s = [
            params.reaction_s + max(now_s - view.stamp_s, view.turn_s, 0.0) for view in self._heard
        ]

    def rim_m_s(self, twist: Twist2D) -> float:
        """No part of the robot is faster."""
        return abs(twist.linear_m_s) + abs(twist.angular_rad_s) * self._outline.radius_m

    def share_of(self, twist: Twist2D) -> tuple[float, str]:
        """How much of its speed the motion may have, 0 to 1 and more, and for what."""
        rim_m_s = self.rim_m_s(twist)
        if rim_m_s < STANDING_M_S:
            return 1.0, ""
        share, limited_by = 1.0, ""
        if self._silent:
            share, limited_by = self._params.scan.silent_speed_m_s / rim_m_s, SILENT + self._silent[0]
        stop_m = self._stop_m(twist)
        for view, delay_s in zip(self._heard, self._delays_s, strict=True):
            allowed = _share(self._params, self._outline, view, twist, delay_s, stop_m)
            if allowed < share:
                share, limited_by = allowed, OBSTACLE + view.lidar
        return share, limited_by

    def _stop_m(self, twist: Twist2D) -> float:
        """How far before what is in its way this motion ends."""
        is_blocked = (
            twist.linear_m_s * self._blocked.linear_m_s > 0
            or twist.angular_rad_s * self._blocked.angular_rad_s > 0
        )
        stop_m = self._params.scan.stop_distance_m
        return release_distance_m(self._params, stop_m) if is_blocked else stop_m

    def most_of(self, whole: Twist2D, share: float) -> Twist2D:
        """As much of the motion as is allowed: a tighter or a wider turn where that is free, else all of it more slowly.

        Where hardly anything is left of the whole, only the turning or only the driving, if more is left of that.
        """
        linear_m_s, angular_rad_s = whole.linear_m_s, whole.angular_rad_s
        if linear_m_s == 0 or angular_rad_s == 0:
            return _scale_twist(whole, share)
        tighter = Twist2D(linear_m_s * share, angular_rad_s)
        wider = Twist2D(linear_m_s, angular_rad_s * share)
        for motion in (tighter, wider):
            if self.share_of(motion)[0] >= WHOLE:
                return motion
        best = share
        motion = _scale_twist(whole, share)
        for part in (Twist2D(0.0, angular_rad_s), Twist2D(linear_m_s, 0.0)):
            allowed = min(self.share_of(part)[0], 1.0)
            if allowed > best + PARTLY:
                best, motion = allowed, _scale_twist(part, allowed)
        return motion


PARTLY = 0.5
"""A part of the motion goes on alone where it may have so much more of its speed than the whole."""


def _scale_twist(twist: Twist2D, share: float) -> Twist2D:
    return Twist2D(twist.linear_m_s * share, twist.angular_rad_s * share)


def _share(
    params: GuardParameters,
    outline: Outline,
    view: View,
    twist: Twist2D,
    delay_s: float,
    stop_m: float,
) -> float:
    """The share of its speed that the motion may have ``stop_m`` before what is in its way; infinity: nothing is.

    Room is counted in seconds of the whole motion. After a delay ``d`` a share ``s`` falls by ``k`` each second, and
    so takes ``s d + s^2 / 2k`` of the room. Of what is left, ``c`` is lost each second to what comes until the robot
    stands: ``c (d + s / k)``.
    """
    linear_m_s, angular_rad_s = abs(twist.linear_m_s), abs(twist.angular_rad_s)
    k = min(
        params.deceleration_m_s2 / linear_m_s if linear_m_s else math.inf,
        params.scan.turn_deceleration_rad_s2 / angular_rad_s if angular_rad_s else math.inf,
    )
    rim_m_s = linear_m_s + angular_rad_s * outline.radius_m
    reach_m = rim_m_s * (delay_s + 1 / (2 * k)) + FASTEST_M_S * (delay_s + 1 / k) + stop_m
    room_of = partial(_room_s, params, outline, twist, stop_m)
    room_s = room_of(reach_m, view.points_m)
    if room_s == math.inf:
        return math.inf
    closing = _closing_rate(view, partial(room_of, reach_m + FASTEST_M_S * view.before_s), room_s, rim_m_s)
    left_s, slope_s = room_s - closing * delay_s, delay_s + closing / k
    return k * (math.sqrt(slope_s * slope_s + 2 * left_s / k) - slope_s) if left_s > 0 else 0.0


def _closing_rate(view: View, room_of: Callable[[Floats], float], room_s: float, rim_m_s: float) -> float:
    """How many seconds of room are lost in a second to what comes closer from turn to turn."""
    if view.earlier is None:
        return 0.0
    between, before = view.earlier
    lost_s = room_of(before()) - room_s
    if not NOISE_M < lost_s * rim_m_s <= FASTEST_M_S * view.before_s + ROUNDING_M:
        return 0.0
    lately_s = room_of(between()) - room_s
    return lost_s / view.before_s if STEADY * lost_s <= lately_s <= (1 - STEADY) * lost_s else 0.0


def _room_s(
    params: GuardParameters, outline: Outline, twist: Twist2D, stop_m: float, reach_m: float, points_m: Floats
) -> float:
    """Seconds of the whole motion until the first point within reach is ``stop_m`` before the outline and its clearance.

    Infinity: there is none. Minus infinity: the motion brings the robot closer to what is within its clearance.
    """
    clearance_m = params.scan.clearance_m
    x, y = points_m[:, 0], points_m[:, 1]
    reach_m += outline.radius_m + 2 * clearance_m
    close = (x * x + y * y) < reach_m * reach_m
    x, y = x[close], y[close]
    outside_m = outline.distances(x, y)
    if outside_m.min(initial=math.inf) <= clearance_m:
        near = (outside_m > 0) & (outside_m <= clearance_m)  # what is within the outline is the robot itself
        if near.any() and outline.closing_speed_m_s(x[near], y[near], twist).max() > CLOSING_M_S:
            return -math.inf
        beyond = outside_m > clearance_m
        x, y = x[beyond], y[beyond]
    if not len(x):
        return math.inf
    grown, linear_m_s, angular_rad_s = outline.grown(clearance_m), twist.linear_m_s, twist.angular_rad_s
    if abs(angular_rad_s) < STRAIGHT_RAD_S:
        way_m = grown.straight_ways(x, y, forward=linear_m_s > 0)
        return float(way_m.min() - stop_m) / abs(linear_m_s)
    centre_m = linear_m_s / angular_rad_s
    angle_rad = grown.arc_angles(x, y, centre_m, left=angular_rad_s > 0)
    (touching,) = (angle_rad < math.inf).nonzero()
    if not len(touching):
        return math.inf
    radius_m = np.hypot(x[touching], y[touching] - centre_m)
    before_rad = stop_m / np.maximum(radius_m, 1e-3)
    return float((angle_rad[touching] - before_rad).min()) / abs(angular_rad_s)
