"""The world model: the map with its zones, obstacles that are not on it, moving ones, and the robot's own trail."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.surfaces import places
from chefbotd.components.navigation.algorithms.arcs import (
    FORESIGHT_S,
    MARGIN_M,
    MOVING_MARGIN_M,
    UNMAPPED_MARGIN_M,
    nearest_in_turn,
)
from chefbotd.components.navigation.algorithms.costmap import (
    Costmap,
    between_cells_at,
    costmap,
    with_obstacles,
    without_thing,
)
from chefbotd.components.navigation.algorithms.grid import Flags, Floats, GridFrame, place_points
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, Seen
from chefbotd.components.navigation.algorithms.live import (
    EXPLAINED_M,
    RANGE_KEPT_S,
    LiveObstacles,
    is_marked,
    is_occupied,
    moved_with,
    nothing_seen,
    obstacles_seen,
    part_of,
    see_range,
    see_scan,
)
from chefbotd.components.navigation.algorithms.movers import (
    SLOWEST_M_S,
    Mover,
    displace_movers,
    track,
    with_people,
)
from chefbotd.components.navigation.algorithms.noise import BELIEVED_M, Noise, after_turn, find_confirmed
from chefbotd.components.navigation.algorithms.outline import clearance_m
from chefbotd.components.navigation.algorithms.recovery import CLOSED_RADIUS_M, LEAVES_S, Trail, extend_trail
from chefbotd.components.navigation.algorithms.removed import (
    THERE_TURNS,
    carried_over,
    find_gone,
    find_things,
    forgotten,
    hear,
    see_through,
)
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.zones.zone_file import Zones
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.sentence import Sentence
from chefbotd.perception.surface_points import smooth_points

NEAR_M: Final = 1.6
"""Points farther away than this do not matter for the next motion."""

BRIDGED_S = 0.5
"""For so long after a scan things are expected to go on as they moved in it."""

AT_PLACE_M = 0.45
"""A person so near to a place is at it."""

BESIDE_M = 0.3
"""A guard may stop the robot for an obstacle so near to its outline."""

GUARDED_M = 0.12
"""A guard that holds the robot back before its goal does so for what is so near to its outline."""

JUMP_M = 0.06
"""A pose so much farther from the last one than the robot can have gone is a correction."""

VOID_M, VOID_RAD = 0.3, 0.35
"""After a correction of so much, what was seen before is not where it was thought to be: the pose was wrong."""

FITS_SHARE: Final = 0.5
"""A turn of which a smaller share belongs to the map says nothing of what is gone from it."""

HEARD_M: Final = 0.15
"""What a range sensor hears so near to a thing of the map may be that thing."""

KEPT_LOW_M = 1.0
"""What depth cameras saw so near goes with the robot when its pose jumps: they do not see the floor beside it."""


def ground_costs(
    params: NavigationParameters, grid: OccupancyGrid, zones: Zones, closed: Flags | None = None
) -> Costmap:
    """The costs of a map, its zones and its ``closed`` cells for this robot, before it has seen anything."""
    return costmap(
        params.outline,
        grid,
        params.follower.max_speed_m_s,
        zones,
        closed,
        unknown_space=params.unknown_space,
        comfort_m=params.comfort_m,
        guards=params.guards,
    )


class WorldModel:
    """Takes the readings of sensors; gives the costs to plan with, and the points to drive by."""

    def __init__(
        self, params: NavigationParameters, grid: OccupancyGrid, zones: Zones, closed: Flags | None = None
    ) -> None:
        self._params = params
        self.ground: Costmap = ground_costs(params, grid, zones, closed)
        self._mapped = self.ground
        self.things = find_things(self.ground.walls, self.ground.frame)
        self._gone = np.zeros(len(self.things.centers_m), np.bool_)
        self._live = nothing_seen(self.ground.frame)
        self._noise = Noise()
        self._low: LiveObstacles | None = None  # what depth cameras see, which lidars look over or under
        self._movers: tuple[Mover, ...] = ()
        self._points_m = np.zeros((0, 2))
        self.walls_seen_m: Floats = np.zeros((0, 2))
        """The points of the last scan that belong to the map, as they were measured, in the grid's frame."""
        self._velocity_m_s = np.zeros((0, 2))
        self._is_unmapped: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._intent_m_s = np.zeros((0, 2))
        self._is_walker: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._walked_s: Floats | None = None  # when a walker was on a cell; made for the first one
        self._seen_from = Pose2D()
        self._closed: list[tuple[float, Floats]] = []
        self.scan_stamp_s = -math.inf
        self.planned_costs = self.ground
        self.trail: Trail = ()

    def redraw(self, grid: OccupancyGrid, zones: Zones, closed: Flags | None) -> None:
        """The same map, edited or with other zones: what was seen stays, and where the robot came from."""
        self.ground = self._mapped = self.planned_costs = ground_costs(self._params, grid, zones, closed)
        self.things, self._gone = carried_over(
            self.things, self._gone, find_things(self.ground.walls, self.frame)
        )
        self.ground = self._without(np.flatnonzero(self._gone))

    @property
    def frame(self) -> GridFrame:
        """The map's."""
        return self.ground.frame

    def add_scan(self, seen: Seen, *, is_sure: bool = True) -> bool:
        """Remember what lidars show; whether the pose has jumped so far that what was seen before is forgotten.

        From a pose that is not sure nothing of the map is taken for gone.
        """
        pose = self.frame.pose_to_grid(seen.map_from_base)
        is_void = self._is_void(pose, seen.stamp_s)
        if is_void:
            self._forget_seen(pose)
        elif self._has_jumped(pose, seen.stamp_s):
            self._movers = displace_movers(self._movers)
        self._seen_from = pose
        points, sensor = place_points(pose, seen.points_m), place_points(pose, places(seen.sensor_m))
        confirmed = find_confirmed(self._noise, points, sensor)
        away_m = between_cells_at(self.ground.fixed_m, self.frame.resolution_m, points)
        is_known = np.asarray(away_m <= EXPLAINED_M) & self._is_on_map(points)
        is_noise = ~confirmed & ~is_known & ~is_marked(self._live, self.frame, points)
        self._noise = after_turn(self._noise, points, is_noise)
        reach_m = self._params.outline.outer_radius_m + BELIEVED_M
        near = np.hypot(points[:, 0] - pose.x_m, points[:, 1] - pose.y_m) <= reach_m
        beams = sensor[confirmed] if len(sensor) == len(points) else sensor
        self._live = see_scan(self._live, self.frame, seen.stamp_s, beams, points[confirmed])
        if is_sure and len(points) and float(is_known.mean()) >= FITS_SHARE:
            see_through(self.things, self.frame, beams, points[confirmed])
        kept, self.walls_seen_m = confirmed | near, points[(confirmed | near) & is_known]
        points = smooth_points(points, sensor if len(sensor) == len(points) else sensor[0])
        sensor = sensor[kept] if len(sensor) == len(points) else sensor
        points, away_m = points[kept], away_m[kept]
        self._is_unmapped = np.asarray(away_m > EXPLAINED_M)
        self._velocity_m_s, self._is_walker = np.zeros_like(points), np.zeros(len(points), np.bool_)
        self._intent_m_s = np.zeros_like(points)
        seen_from = np.broadcast_to(sensor, points.shape) if len(sensor) == 1 else sensor
        done = track(self._movers, seen.stamp_s, points[self._is_unmapped], seen_from[self._is_unmapped])
        self._movers = done.movers
        self._velocity_m_s[self._is_unmapped] = done.velocity_m_s
        self._intent_m_s[self._is_unmapped] = done.intent_m_s
        self._is_walker[self._is_unmapped] = done.is_walker
        self._points_m, self.scan_stamp_s = points, seen.stamp_s
        self._mark_walked(points[self._is_walker], seen.stamp_s)
        return is_void

    def _is_on_map(self, points_m: Floats) -> NDArray[np.bool_]:
        """Which points of the grid's frame are on it."""
        most_m = np.array([self.frame.columns, self.frame.rows]) * self.frame.resolution_m
        inside: NDArray[np.bool_] = np.asarray(((points_m >= 0) & (points_m <= most_m)).all(axis=1))
        return inside

    def _is_void(self, pose: Pose2D, stamp_s: float) -> bool:
        """Whether the pose was corrected by so much that what was seen from it before is void."""
        if self.scan_stamp_s == -math.inf:
            return False
        last, limits, passed_s = self._seen_from, self._params.follower, stamp_s - self.scan_stamp_s
        gone_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
        turned_rad = abs(math.remainder(pose.heading_rad - last.heading_rad, math.tau))
        could_m, could_rad = 1.5 * limits.max_speed_m_s * passed_s, 1.5 * limits.max_turn_rad_s * passed_s
        return gone_m > VOID_M + could_m or turned_rad > VOID_RAD + could_rad

    def _forget_seen(self, pose: Pose2D) -> None:
        """Forget what was seen from a pose that was wrong, and where the robot came from."""
        self._live, self._movers, self._noise = nothing_seen(self.frame), (), Noise()
        self._walked_s = None
        self._closed, self.trail = [], ()
        self.things, self.ground = forgotten(self.things), self._mapped
        self._gone.fill(False)
        if self._low is not None:
            correction = pose.compose(self._seen_from.inverse())
            self._low = moved_with(self._low, self.frame, self._seen_from, correction, KEPT_LOW_M)

    @property
    def noise_share(self) -> float:
        """The share of the lidars' points that neither other beams nor other turns confirm, lately."""
        return self._noise.share

    def _has_jumped(self, pose: Pose2D, stamp_s: float) -> bool:
        """Whether the pose is farther from that of the last scan than the robot can have gone."""
        last = self._seen_from
        gone_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
        could_m = 1.5 * self._params.follower.max_speed_m_s * (stamp_s - self.scan_stamp_s)
        return gone_m > JUMP_M + could_m

    def take_low_scan(self, seen: Seen) -> None:
        """Remember what a depth camera shows: only its own beams clear it, since a lidar's pass above or below it."""
        pose = self.frame.pose_to_grid(seen.map_from_base)
        points, sensor = place_points(pose, seen.points_m), place_points(pose, places(seen.sensor_m))
        before = self._low or nothing_seen(self.frame)
        self._low = see_scan(before, self.frame, seen.stamp_s, sensor, points)

    def _mark_walked(self, points_m: Floats, stamp_s: float) -> None:
        if not len(points_m):
            return
        columns, rows = np.floor(points_m / self.frame.resolution_m).astype(np.int64).T
        inside = (rows >= 0) & (rows < self.frame.rows) & (columns >= 0) & (columns < self.frame.columns)
        if self._walked_s is None:
            self._walked_s = np.full(self.ground.costs.shape, -math.inf)
        self._walked_s[rows[inside], columns[inside]] = stamp_s

    def add_range(
        self, stamp_s: float, map_from_base: Pose2D, base_from_sensor: Pose2D, range_m: float, view_rad: float
    ) -> None:
        """Remember an echo of an ultrasonic or infrared sensor with a field of view."""
        sensor = self.frame.pose_to_grid(map_from_base).compose(base_from_sensor)
        echo = sensor.compose(Pose2D(range_m, 0.0))
        hear(self.things, self.frame, np.array([echo.x_m, echo.y_m]), HEARD_M)
        self._live = see_range(
            self._live, self.frame, self.ground.fixed_m, stamp_s, sensor, range_m, view_rad
        )

    def close(self, place: Floats, until_s: float) -> None:
        """Take a place (x, y of the grid's frame) for an obstacle for some time."""
        self._closed.append((until_s, place.copy()))

    def open_gone(self) -> bool:
        """Plan without the things of the map that are gone; whether others are gone than before."""
        gone = find_gone(self.things, self._gone)
        if (gone == self._gone).all():
            return False
        self._gone, self.ground = gone, self._without(np.flatnonzero(gone))
        return True

    def _without(self, things: NDArray[np.int64]) -> Costmap:
        ground = self._mapped
        for thing in things:
            ground = without_thing(ground, self.things.cells[self.things.thing == thing])
        return ground

    def ground_without(self, things: NDArray[np.int64]) -> Costmap:
        """The map without these things, and without those that are gone."""
        return self._without(np.union1d(np.flatnonzero(self._gone), things))

    def is_there(self, thing: int) -> bool:
        """Whether the lidar sees something where a thing of the map is, or may be glass."""
        return bool(self.things.ended[thing] >= THERE_TURNS or self.things.is_glass[thing])

    def open_all(self) -> None:
        """No place is closed any more."""
        self._closed = []

    def costs(self, now_s: float, pose: Pose2D | None = None, *, with_closed: bool = True) -> Costmap:
        """The costs with all that is seen now; with people who walk only for a robot that sets out from ``pose``.

        They are ``ground`` itself if nothing but the map is there.
        """
        seen = self._seen(now_s, self._walked_s)
        stood = with_obstacles(self.ground, self._with_closed(seen, now_s) if with_closed else seen)
        if pose is None:
            return stood
        walkers = [mover for mover in self._movers if mover.is_walker and mover.stamp_s == self.scan_stamp_s]
        speed_m_s = self._params.follower.max_speed_m_s
        return with_people(stood, walkers, pose.x_m, pose.y_m, speed_m_s)

    def costs_to_plan(self, now_s: float, pose: Pose2D, *, with_closed: bool) -> Costmap:
        """The same, kept as the costs that the last plan was made with."""
        self.planned_costs = self.costs(now_s, pose, with_closed=with_closed)
        return self.planned_costs

    def remember_drive(self, pose: Pose2D, twist: Twist2D) -> None:
        """Keep the trail of a robot that is here (in the grid's frame) and drives so."""
        self.trail = extend_trail(self.trail, pose, twist)

    def meets_walker(self, pose: Pose2D) -> bool:
        """Whether the nearest thing in front of a pose of the grid's frame is a person who will walk on."""
        points = place_points(pose.inverse(), self._points_m)
        apart_m = np.where(points[:, 0] > 0, np.hypot(points[:, 0], points[:, 1]), math.inf)
        return bool(len(points) and self._is_walker[int(np.argmin(apart_m))])

    def may_leave(self, place: Floats, now_s: float) -> bool:
        """Whether a person who may leave is at a place of the grid: he walked there, and has not stood for long."""
        cell = self.frame.cell(float(place[0]), float(place[1]))
        if cell is None or self._walked_s is None:
            return False
        reach = math.ceil(AT_PLACE_M / self.frame.resolution_m)
        box = tuple(slice(max(at - reach, 0), at + reach + 1) for at in cell)
        seen = part_of(self._live, (box[0], box[1]))
        stood_s = np.where(is_occupied(seen, now_s), seen.scan_s - seen.since_s, 0.0)
        walked_s = float(self._walked_s[box].max())
        return now_s - walked_s < LEAVES_S and float(stood_s.max()) < LEAVES_S

    def obstacles(self, now_s: float) -> Floats:
        """Where something is now that the map does not explain: points (n, 2) of the grid's frame."""
        return self._seen(now_s)

    def _seen(self, now_s: float, walked_s: Floats | None = None) -> Floats:
        """The same, without those who have walked on."""
        fixed_m = self.ground.fixed_m
        layers = [self._live] if self._low is None else [self._live, self._low]
        return np.vstack([obstacles_seen(layer, fixed_m, now_s, walked_s) for layer in layers])

    def movers_in_map(self, now_s: float) -> Floats:
        """What moves: (n, 4), position and velocity in the map; only what was seen lately."""
        moving = [
            (mover.x_m, mover.y_m, mover.vx_m_s, mover.vy_m_s)
            for mover in self._movers
            if now_s - mover.stamp_s <= BRIDGED_S and math.hypot(mover.vx_m_s, mover.vy_m_s) > SLOWEST_M_S
        ]
        rows = np.array(moving).reshape(-1, 4)
        turn = Pose2D(0.0, 0.0, self.frame.map_from_grid.heading_rad)
        return np.hstack([self.frame.to_map(rows[:, :2]), place_points(turn, rows[:, 2:])])

    def _with_closed(self, points_m: Floats, now_s: float) -> Floats:
        self._closed = [(until_s, place) for until_s, place in self._closed if until_s > now_s]
        radius_m = CLOSED_RADIUS_M
        around = np.arange(-radius_m, radius_m + 1e-9, self.frame.resolution_m)
        disc = np.array([(x, y) for x in around for y in around if math.hypot(x, y) <= radius_m])
        return np.vstack([points_m, *(place + disc for _, place in self._closed)])

    def surroundings(self, pose: Pose2D, now_s: float, speed_m_s: float = 0.0) -> Surroundings:
        """What is around a pose of the grid's frame: the last scan, its movers moved on, and what was seen before."""
        bridged_s = np.full(len(self._points_m), min(max(now_s - self.scan_stamp_s, 0.0), BRIDGED_S))
        bridged_s[self._is_walker] += self._params.follower.delay_s
        remembered = self._remembered(pose, now_s)
        points = np.vstack([self._points_m + self._velocity_m_s * bridged_s[:, None], remembered])
        velocity = np.vstack([self._velocity_m_s, np.zeros_like(remembered)])
        intent = np.vstack([self._intent_m_s, np.zeros_like(remembered)])
        margin = np.where(self._is_unmapped, UNMAPPED_MARGIN_M, MARGIN_M)
        is_moving = np.hypot(self._velocity_m_s[:, 0], self._velocity_m_s[:, 1]) > 0
        margin = np.where(is_moving | self._is_walker, margin + MOVING_MARGIN_M, margin)
        margin = np.append(margin, np.full(len(remembered), MARGIN_M))
        reach_m = NEAR_M + FORESIGHT_S * np.hypot(velocity[:, 0], velocity[:, 1])
        near = np.hypot(points[:, 0] - pose.x_m, points[:, 1] - pose.y_m) < reach_m
        back = pose.inverse()
        turned = Pose2D(0.0, 0.0, back.heading_rad)
        return Surroundings(
            place_points(back, points[near]),
            place_points(turned, velocity[near]),
            margin[near],
            self.ground.fixed_m,
            self.frame.resolution_m,
            pose,
            place_points(turned, intent[near]),
            speed_m_s,
            is_walker=np.append(self._is_walker, np.zeros(len(remembered), np.bool_))[near],
        )

    def _remembered(self, pose: Pose2D, now_s: float) -> Floats:
        """Points that the last scan does not show: of a sonar or a depth camera, or hidden from the lidar now."""
        frame, stamp_s = self.frame, self.scan_stamp_s
        reach = math.ceil(NEAR_M / frame.resolution_m)
        row, column = int(pose.y_m / frame.resolution_m), int(pose.x_m / frame.resolution_m)
        top, left = max(row - reach, 0), max(column - reach, 0)
        box = (slice(top, max(row + reach + 1, 0)), slice(left, max(column + reach + 1, 0)))
        seen = part_of(self._live, box)
        unmapped = self.ground.fixed_m[box] > EXPLAINED_M
        hidden = (seen.scan_s < stamp_s) | (seen.range_s > now_s - RANGE_KEPT_S)
        kept = is_occupied(seen, now_s) & hidden & unmapped
        if self._low is None:
            return seen.at_m[kept]
        low = part_of(self._low, box)
        return np.vstack([seen.at_m[kept], low.at_m[is_occupied(low, now_s) & unmapped]])

    def nearest_ahead(self, surroundings: Surroundings, turns_rad: float = 0.0) -> str:
        """Where in the map the nearest point is, or the first that a turn on the spot meets, as a part of a sentence."""
        if not len(surroundings.points_m):
            return ""
        k = int(np.argmin(np.hypot(surroundings.points_m[:, 0] - 0.1, surroundings.points_m[:, 1])))
        if turns_rad:
            k = nearest_in_turn(self._params.outline, surroundings, turns_rad)
        return self._where(surroundings, k)

    def wall_beside(self, surroundings: Surroundings) -> str:
        """Where in the map its own wall is that is nearest to the outline, and near enough for a guard; else empty."""
        if not len(surroundings.points_m):
            return ""
        outline = self._params.outline
        k = nearest_in_turn(outline, surroundings, 0.0)
        x_m, y_m = (float(value) for value in surroundings.points_m[k])
        point = surroundings.grid_from_base.compose(Pose2D(x_m, y_m))
        at = np.array([[point.x_m, point.y_m]])
        is_mapped = between_cells_at(self.ground.fixed_m, self.frame.resolution_m, at)[0] <= EXPLAINED_M
        is_near = clearance_m(outline.hull, outline.pad_m, x_m, y_m) < GUARDED_M
        return self._where(surroundings, k) if is_mapped and is_near else ""

    def beside(self, surroundings: Surroundings) -> str:
        """Where in the map a point is that a guard may stop the robot for, as a part of a sentence."""
        outline = self._params.outline
        if not len(surroundings.points_m):
            return ""
        k = nearest_in_turn(outline, surroundings, 0.0)
        x_m, y_m = surroundings.points_m[k]
        apart_m = clearance_m(outline.hull, outline.pad_m, float(x_m), float(y_m))
        return self._where(surroundings, k) if apart_m < BESIDE_M else ""

    def _where(self, surroundings: Surroundings, k: int) -> str:
        point = surroundings.grid_from_base.compose(
            Pose2D(float(surroundings.points_m[k, 0]), float(surroundings.points_m[k, 1]))
        )
        place = self.frame.pose_to_map(point)
        return Sentence("navigation.at", " at ({x_m:.2f}, {y_m:.2f})", x_m=place.x_m, y_m=place.y_m)
