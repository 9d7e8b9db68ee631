"""Keeps scans for the obstacle guard, as points relative to the robot's present pose.

Only a robot with a lidar loads this: it needs numpy.
"""

import math
from collections.abc import Collection, Sequence
from functools import cache, partial
from typing import Protocol

import numpy as np
from msgspec import field

from chefbotd.bus import Bus, OnError
from chefbotd.clock import Clock
from chefbotd.core.events import WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import STANDING, Motion, Pose2D, Twist2D
from chefbotd.core.poses import row_of, transform
from chefbotd.core.record import MutableState, Record, StatefulPart, replace
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.perception.laser_scan import OdometryTrack, points_in_base
from chefbotd.perception.lone_points import find_lone
from chefbotd.perception.surface_points import smooth_points
from chefbotd.safety import guard, scan_guard
from chefbotd.safety.guard import GuardParameters
from chefbotd.safety.outline import Box, Disc, Floats, Outline
from chefbotd.safety.scan_guard import NOT_SEEN, View

TRAIL = 200
"""The number of kept poses: several seconds, more than a turn of the lidar and its transmission take."""

NEAR_MARGIN_M, NEAR_CELL_M = 0.02, 0.02
"""Points up to this far beyond the nearest reading may become invisible; they are kept in cells of this size."""

TURNS_LOOKED_AT = 2
"""The number of turns that are looked at: a point that one turn misses is in the one before."""

TURNS_KEPT = TURNS_LOOKED_AT + 2
"""Looks one and two turns earlier show what comes closer."""


class _Seen(Record, frozen=True):
    """A scan's points in the frame of the trail; ``lone_m`` are those that nothing has confirmed yet."""

    points_m: Floats
    stamp_s: float
    arrival_s: float
    turn_s: float
    lone_m: Floats = field(default_factory=lambda: np.zeros((0, 2)))


WHEEL_WIDTH_M = 0.025
"""The width of a wheel (assumed); half of it is outside the track on either side."""


def outline_of(
    chassis: ChassisParameters, body_m: tuple[float, float | None] | None, wheelbase_m: float
) -> Outline:
    """The outline of body and wheels; ``body_m`` is the body's length and width, or its diameter and None.

    Without a body it is the box around the wheels.
    """
    sides = [wheel.side for wheel in chassis.wheels]
    axles_m = wheelbase_m if max(sides.count(side) for side in sides) > 1 else 0.0
    half_length_m = max(wheel.radius_m for wheel in chassis.wheels) + axles_m / 2
    half_width_m = (chassis.track_width_m + WHEEL_WIDTH_M) / 2
    if body_m is None:
        return Box(half_length_m, half_width_m)
    length_m, width_m = body_m
    if width_m is None:
        return Disc(max(length_m / 2, math.hypot(half_length_m, half_width_m)))
    return Box(max(length_m / 2, half_length_m), max(width_m / 2, half_width_m))


class GuardSensor(Protocol):
    """The properties of a lidar or depth camera that the guard needs."""

    @property
    def name(self) -> str:
        """Its scans' name."""
        ...

    @property
    def guards(self) -> bool:
        """Whether the guard uses it."""
        ...

    @property
    def band_m(self) -> tuple[float, float]:
        """The nearest and the farthest reading that is used."""
        ...


class ScanWatchState(MutableState):
    """The last turns of each sensor, the trail (stamps and poses, and the newest pose), and what is blocked."""

    seen: dict[str, list[_Seen]]
    trail: list[tuple[float, float, float, float]] = []
    pose: Pose2D = Pose2D()
    blocked: Twist2D = STANDING


class ScanWatch(StatefulPart[ScanWatchState]):
    """Keeps the last turns of each guarding lidar, and the robot's trail since.

    A lidar's lone points are no obstacles until the next turn confirms them: sunlight and dust make such. The first
    turn is believed whole, and so is each one after a silence. A depth camera (in ``blind_near``) does not see very
    near points. Those that it saw before are kept until the robot has moved away from them. The watch has its own
    trail, in which a pose that a client sets is no motion.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        parameters: GuardParameters,
        chassis: ChassisParameters,
        sensors: Sequence[GuardSensor],
        outline: Outline,
        *,
        blind_near: Collection[str] = (),
        on_error: OnError,
    ) -> None:
        self._clock, self._parameters, self._outline = clock, parameters, outline
        self._kinematics = Kinematics(chassis)
        self._bands_m = bands = {sensor.name: sensor.band_m for sensor in sensors if sensor.guards}
        self._near_m = {name: bands[name][0] + NEAR_MARGIN_M for name in blind_near if name in bands}
        self.memory = ScanWatchState({name: [] for name in bands})
        bus.add_handler(self._on_wheels, WheelsMeasured, on_error=on_error)
        bus.add_handler(self._on_scan, ScanMeasured, on_error=on_error)

    def restore(self, state: ScanWatchState) -> None:
        """Restore this state, as far as it is of sensors that guard now."""
        super().restore(state)
        self.memory.seen = {name: state.seen.get(name, [])[-TURNS_KEPT:] for name in self._bands_m}
        self.memory.trail = state.trail[-TRAIL:]

    def limit(self, motion: Motion, now_s: float, late_s: float = 0.0) -> tuple[Motion, str | None]:
        """The motion that may be driven, and what it was limited for; the board obeys ``late_s`` later than usual."""
        views = [self._view(name) for name in self.memory.seen]
        params = guard.later(self._parameters, late_s)
        allowed, limited_by = scan_guard.limit(
            params, self._outline, views, motion, now_s, self.memory.blocked
        )
        self.memory.blocked = scan_guard.blocked_after(self.memory.blocked, motion, allowed)
        return allowed, limited_by

    def _on_wheels(self, event: WheelsMeasured) -> None:
        """Interpolate the trail linearly: between two readings a robot turns by only a degree or two."""
        left_m, right_m = self._kinematics.side_travel_m(event.travel_rad, event.excluded)
        turned_rad = (right_m - left_m) / self._kinematics.track_width_m
        way_m, half_rad = (left_m + right_m) / 2, turned_rad / 2
        step = Pose2D(way_m * math.cos(half_rad), way_m * math.sin(half_rad), turned_rad)
        pose, trail = self.memory.pose.compose(step), self.memory.trail
        self.memory.pose = pose
        if trail and event.stamp_s <= trail[-1][0]:
            trail.pop()
        elif len(trail) == TRAIL:
            del trail[0]
        trail.append((event.stamp_s, pose.x_m, pose.y_m, pose.heading_rad))

    def _on_scan(self, event: ScanMeasured) -> None:
        band_m = self._bands_m.get(event.lidar)
        if band_m is None:
            return
        trail = (
            np.array(self.memory.trail) if self.memory.trail else np.array([[event.stamp_s, 0.0, 0.0, 0.0]])
        )
        track = OdometryTrack(trail[:, 0], trail[:, 1:])
        in_base = points_in_base(band_m, event.base_from_lidar, event.scan, track)
        trail_from_base = _pose_at(trail, event.stamp_s)
        after_s = event.scan.after_s
        turn_s = float(np.ptp(after_s)) if len(after_s) else 0.0
        points_m = transform(row_of(trail_from_base), in_base)
        sensor, lone_m = trail_from_base.compose(event.base_from_lidar), NOT_SEEN
        if event.lidar in self._near_m:
            points_m = self._with_near(event.lidar, points_m, sensor)
        else:
            points_m = smooth_points(points_m, np.array([sensor.x_m, sensor.y_m]))
            points_m, lone_m = self._without_lone(event, turn_s, points_m, sensor)
        turns = self.memory.seen[event.lidar]
        turns.append(_Seen(points_m, event.stamp_s, self._clock.now_s(), turn_s, lone_m))
        del turns[:-TURNS_KEPT]

    def _without_lone(
        self, event: ScanMeasured, turn_s: float, points_m: Floats, sensor: Pose2D
    ) -> tuple[Floats, Floats]:
        """The points that a beam beside them or an earlier turn confirms, and the others."""
        oldest_s = event.stamp_s - (TURNS_LOOKED_AT + 1) * turn_s
        earlier = [
            turn for turn in self.memory.seen[event.lidar][-TURNS_LOOKED_AT:] if turn.stamp_s > oldest_s
        ]
        if not earlier or not len(points_m):
            return points_m, NOT_SEEN
        raw = [np.concatenate((turn.points_m, turn.lone_m)) for turn in earlier]
        lone = find_lone(points_m, np.array([sensor.x_m, sensor.y_m]), earlier=raw)
        return points_m[~lone], points_m[lone]

    def _with_near(self, name: str, points_m: Floats, sensor: Pose2D) -> Floats:
        """These points, and the earlier points that are too near to the sensor to be seen now."""
        seen = self.memory.seen[name]
        if not seen:
            return points_m
        before = seen[-1].points_m
        is_near = np.hypot(before[:, 0] - sensor.x_m, before[:, 1] - sensor.y_m) < self._near_m[name]
        kept = np.unique(np.round(before[is_near] / NEAR_CELL_M), axis=0) * NEAR_CELL_M
        return np.concatenate((points_m, kept))

    def _view(self, name: str) -> View:
        """The lidar's last turns, relative to the robot's present pose."""
        seen = self.memory.seen[name]
        if not seen:
            return View(name, NOT_SEEN, -math.inf, -math.inf, 0.0)
        turns, newest, here = seen, seen[-1], row_of(self.memory.pose.inverse())
        recent = [
            turn for turn in turns[-TURNS_LOOKED_AT:] if newest.stamp_s - turn.stamp_s <= 2 * newest.turn_s
        ]
        points_m = _points_m(recent or [newest], here)
        view = View(name, points_m, newest.stamp_s, newest.arrival_s, newest.turn_s)
        if len(turns) < TURNS_KEPT or newest.stamp_s - turns[0].stamp_s > (TURNS_KEPT + 1) * newest.turn_s:
            return view  # too few turns, or old ones
        between, before = (
            cache(partial(_points_m, turns[first : first + TURNS_LOOKED_AT], here)) for first in (1, 0)
        )
        before_s = newest.stamp_s - turns[TURNS_LOOKED_AT - 1].stamp_s
        return replace(view, earlier=(between, before), before_s=before_s)


def _points_m(turns: Sequence[_Seen], here: Floats) -> Floats:
    return transform(here, np.concatenate([turn.points_m for turn in turns]))


def _pose_at(trail: Floats, stamp_s: float) -> Pose2D:
    heading = np.unwrap(trail[:, 3])
    x_m, y_m, heading_rad = (
        float(np.interp(stamp_s, trail[:, 0], column)) for column in (trail[:, 1], trail[:, 2], heading)
    )
    return Pose2D(x_m, y_m, heading_rad)
