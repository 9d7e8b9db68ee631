"""The skill that drives to goals, on the map and with the pose of the skill ``localization``."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Final

import numpy as np

from chefbotd.components.localization.algorithms.state import PoseState
from chefbotd.components.localization.edited_map import EditedMap, edited_map
from chefbotd.components.localization.skill import LocalizationSkill
from chefbotd.components.mapping.aligned_scans import AlignedScan, ScanAligner
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.navigation import skill_requests as requests
from chefbotd.components.navigation.algorithms.arrival import (
    Arrival,
    ArrivalData,
    begin_arrival,
    watch_arrival,
)
from chefbotd.components.navigation.algorithms.costmap import GuardDistances
from chefbotd.components.navigation.algorithms.grid import GridFrame
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, Seen, Step
from chefbotd.components.navigation.algorithms.navigator import Navigator
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Path
from chefbotd.components.navigation.algorithms.states import GoalState
from chefbotd.components.navigation.algorithms.warm import warm
from chefbotd.components.navigation.algorithms.world_model import ground_costs
from chefbotd.components.navigation.algorithms.zone_effects import (
    COVERED_BY_EDITS,
    COVERED_BY_ZONES,
    find_concerns,
)
from chefbotd.components.navigation.algorithms.zones import require_affordable
from chefbotd.components.navigation.events import GoalResult, NavigationData, PathData, PlanResult
from chefbotd.components.navigation.robot_limits import agility_of, follower_limits
from chefbotd.components.navigation.skill_requests import (
    GoalAsked,
    MapChecked,
    NavigationSkillParameters,
    Stepped,
)
from chefbotd.components.navigation.skill_shown import LayerPublisher
from chefbotd.components.zones.zone_file import NO_ZONES, ZONES, Zones, parse_zones
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.core.poses import Floats, compose, row_of
from chefbotd.core.record import replace

if TYPE_CHECKING:
    from chefbotd.clock import Clock
from chefbotd.components.worker.skill import Job, Skill, Struct
from chefbotd.core.sentence import Sentence, sentence_of

MOST_AGE_S: Final = 1.5
"""With odometry that is older nobody knows where the robot is.

The classic board is silent for a second when an echo is missing; the gate lets nothing move meanwhile.
"""

SILENT_S: Final = 0.15
"""Without odometry for so long, the map is placed as before, and for ``HELD_S`` after it is back.

A scan is matched from where odometry left off, and does not find all of the way at once.
"""

HELD_S: Final = 0.3

STUCK_S: Final = 3.0
"""The whole map is searched when there is no way from an uncertain pose for so long."""

STATUS: Final = {PoseState.LOCALIZED: PoseStatus.LOCALIZED, PoseState.UNCERTAIN: PoseStatus.UNCERTAIN}


class NavigationSkill:
    """One navigator, on the map that localization uses."""

    def __init__(self, parameters: bytes, clock: "Clock") -> None:
        settings = NavigationSkillParameters.model_validate_json(parameters)
        self._params = NavigationParameters(
            outline=_outline(settings),
            follower=follower_limits(settings),
            agility=agility_of(settings.limits),
            silent_speed_m_s=settings.silent_speed_m_s,
            unknown_space=settings.navigation.unknown_space,
            comfort_m=settings.navigation.comfort_m,
            guards=GuardDistances(settings.guard_stop_m, settings.guard_clearance_m),
        )
        self._folder, self._clock = settings.folder, clock
        self._navigator = Navigator(self._params)
        self._finder: LocalizationSkill | None = None
        self._map: tuple[str, int] | None = None  # the one that is navigated on,
        self._used: tuple[str, int] | None = None  # and localization's
        self._edited: EditedMap | None = None
        self._problem = ""
        self._odometry: OdometryUpdated | None = None
        self._map_from_odom: Floats | None = None  # by which the robot is placed
        self._scan_s = self._held_until_s = float("-inf")
        self._cameras = {name: ScanAligner((name,)) for name in settings.cameras}
        self._range_mounts = {name: Pose2D(*mount) for name, mount in settings.range_mounts.items()}
        self._numbers: dict[int, int] = {}  # the navigator's number of each goal -> the daemon's
        self._arrival: Arrival | None = None  # at the last goal that was reached
        self._stuck_since_s: float | None = None  # with an uncertain pose
        self._last: Stepped | None = None
        self._path: Path | None = None
        self._layers = LayerPublisher()

    def warm(self) -> None:
        """Load, or compile, all that navigation needs."""
        warm(self._params)

    def connect(self, others: Mapping[str, Skill]) -> None:
        """Know the skill that finds the way."""
        finder = others.get("localization")
        self._finder = finder if isinstance(finder, LocalizationSkill) else None

    def take_scan(self, scan: ScanMeasured) -> Iterable[Struct]:
        """A depth camera's image, flattened; a lidar's turn is aligned by localization first."""
        camera = self._cameras.get(scan.lidar)
        if camera is not None:
            camera.add_scan(scan)
        return ()

    def take_odometry(self, odometry: OdometryUpdated) -> Iterable[Struct]:
        """Where the robot is by odometry; the newest counts."""
        self._odometry = odometry
        for camera in self._cameras.values():
            camera.add_odometry(odometry)
        return ()

    def take_range(self, measured: RangeMeasured) -> Iterable[Struct]:
        """An echo, where it is known where the robot was; the newest odometry is at most a reading older."""
        mount = self._range_mounts.get(measured.sensor)
        if mount is None or measured.range_m is None:
            return ()
        pose, status = self._pose(self._clock.now_s())
        if pose is not None and status is not PoseStatus.LOST:
            view_rad = measured.field_of_view_rad
            self._navigator.take_range(measured.stamp_s, pose, mount, measured.range_m, view_rad)
        return ()

    def close(self) -> None:
        """The daemon ends; there is nothing to keep."""

    # what is asked

    def handle(self, body: bytes) -> Struct | Job | None:
        """One request."""
        self._follow_map()
        navigator = self._navigator
        match requests.REQUEST.decode(body):
            case requests.NavigateTo() as request:
                self._require_map()
                self._require_sound_pose()
                numbers = navigator.navigate_to(tuple(map(_goal, request.goals)), queue=request.queue)
                asked = [goal.number for goal in request.goals]
                self._numbers.update(zip(numbers, asked, strict=True))
            case requests.KeepGoals() as request:
                navigator.keep([mine for mine, theirs in self._numbers.items() if theirs in request.numbers])
            case requests.Pause() as request:
                navigator.pause(sentence_of(request.reason, json.loads(request.said or "{}")))
            case requests.Resume():
                navigator.resume()
            case requests.PlanTo() as request:
                return self._planned(request.goal)
            case requests.Show() as request:
                self._layers.ask(request)
            case requests.CheckMap():
                return MapChecked(self._problem)
            case requests.UseZones():
                # While a map is made ready there is no world, and its zones are read at the end of that.
                if self._navigator.world is not None or self._problem:
                    self._use_zones(is_same_map=True)
                return MapChecked(self._problem)
            case requests.Examine() as request:
                return self._examined(request)
        return None

    def _require_map(self) -> None:
        if self._map is None or self._navigator.world is None:
            reason = self._problem or Sentence(
                "navigation.no_map", "no finished map is in use: load one, or finish the one in progress"
            )
            raise Refused(RefusalKind.NO_MAP_LOADED, reason)

    def _require_sound_pose(self) -> None:
        if self._finder is not None and self._finder.problem:
            raise Refused(RefusalKind.POSE_UNKNOWN, self._finder.problem)

    def _planned(self, goal: GoalAsked) -> PlanResult:
        self._require_map()
        self._require_sound_pose()
        now_s = self._clock.now_s()
        pose, status = self._pose(now_s)
        if pose is None or status is PoseStatus.LOST:
            raise Refused(
                RefusalKind.POSE_UNKNOWN,
                Sentence("navigation.pose_unknown", "where the robot is in the map is not known yet"),
            )
        path = self._navigator.plan_path(pose, _goal(goal), now_s)
        if isinstance(path, NoPath):
            none, near = PlanResult(False, path.reason, only_for_now=path.only_for_now), path.nearest
            if near is None:
                return none
            x_m, y_m, heading_rad = near.x_m, near.y_m, near.heading_rad
            return replace(none, nearest_x_m=x_m, nearest_y_m=y_m, nearest_heading_rad=heading_rad)
        reason = (
            Sentence("navigation.substitute", "the nearest free place within the tolerance")
            if path.is_substitute
            else ""
        )
        time_s = self._navigator.time_s(path, pose)
        return PlanResult(True, reason, path.length_m, time_s, *_points(path))

    # what has its own time

    def step(self, now_s: float) -> Iterable[Struct]:
        """See what localization saw, and say what to do now."""
        self._follow_map()
        if self._finder is None:
            return
        if self._finder.problem:
            self._navigator.fail(self._finder.problem)
        pose, status = self._pose(now_s)
        self._take_seen(self._finder)
        self._take_images(now_s, self._finder)
        self._doubt_pose(now_s, status, self._finder)
        age_s = 0.0 if self._odometry is None else now_s - self._odometry.stamp_s
        done = self._navigator.step(now_s, pose or Pose2D(), status, age_s)
        stepped = self._stepped(now_s, done)
        if (
            stepped.twist is not None
            or stepped.ended
            or stepped.path is not None
            or stepped.arrival is not None
            or self._has_changed(stepped)
        ):
            self._last = stepped
            yield stepped
        world = self._navigator.world
        if self._map is not None and world is not None:
            yield from self._layers.due(now_s, self._map[0], world)

    def _doubt_pose(self, now_s: float, status: PoseStatus, finder: LocalizationSkill) -> None:
        """Have the whole map searched where an uncertain pose may be why there is no way, or is not at the goal."""
        is_stuck = self._navigator.state in (GoalState.RECOVERING, GoalState.PLANNING)
        has_come = self._navigator.is_unsure_at_goal and finder.misfits
        if status is not PoseStatus.UNCERTAIN or not (is_stuck or has_come):
            self._stuck_since_s = None
        elif self._stuck_since_s is None:
            self._stuck_since_s = now_s
        elif now_s - self._stuck_since_s >= STUCK_S:
            self._stuck_since_s = None
            at_goal = Sentence(
                "navigation.unsure_at_goal", "the robot has come to its goal by a pose that is uncertain"
            )
            no_way = Sentence(
                "navigation.unsure_no_way", "the robot finds no way from a pose that is uncertain"
            )
            finder.search_again(at_goal if has_come else no_way)

    def _pose(self, now_s: float) -> tuple[Pose2D | None, PoseStatus]:
        """Where the robot is in the map, by the newest odometry."""
        report = None if self._finder is None else self._finder.report
        odometry = self._odometry
        if report is None or report.map_from_odom is None or odometry is None:
            return None, PoseStatus.LOST
        if now_s - odometry.stamp_s > SILENT_S:
            self._held_until_s = now_s + HELD_S
        if now_s >= self._held_until_s or self._map_from_odom is None or self._navigator.crawls:
            self._map_from_odom = report.map_from_odom
        pose = _pose2d(compose(self._map_from_odom, expect_odometry(odometry, now_s)))
        if now_s - odometry.stamp_s > MOST_AGE_S:
            return pose, PoseStatus.LOST
        return pose, STATUS.get(report.state, PoseStatus.LOST)

    def _take_seen(self, finder: LocalizationSkill) -> None:
        """The newest scan; what was seen while the robot was lost cannot be placed."""
        seen, report = finder.seen, finder.report
        if seen is None or seen.stamp_s <= self._scan_s or report is None or self._map_from_odom is None:
            return
        self._scan_s = seen.stamp_s
        if report.state in STATUS:
            self._navigator.take_scan(self._placed(self._map_from_odom, seen))

    def _take_images(self, now_s: float, finder: LocalizationSkill) -> None:
        """What depth cameras saw; nothing of it is used to find the way."""
        report = finder.report
        for camera in self._cameras.values():
            while (image := camera.next_aligned(now_s)) is not None:
                if report is None or self._map_from_odom is None or report.state not in STATUS:
                    continue  # where that was is not known
                self._navigator.take_low_scan(self._placed(self._map_from_odom, image))

    def _placed(self, map_from_odom: Floats, seen: AlignedScan) -> Seen:
        """What was seen, where the robot was then; without odometry of that time where it was expected."""
        odometry, odom_from_base = self._odometry, seen.odometry
        if odometry is not None and odometry.stamp_s < seen.stamp_s:
            odom_from_base = expect_odometry(odometry, seen.stamp_s)
        points = np.asarray(seen.scan.points, np.float64)
        return Seen(seen.stamp_s, _pose2d(compose(map_from_odom, odom_from_base)), seen.scan.sensor_m, points)

    def _stepped(self, now_s: float, done: Step) -> Stepped:
        progress = done.progress
        planned = self._navigator.planned
        is_new, self._path = planned is not self._path, planned
        number = None if progress.goal is None else self._numbers.get(progress.goal)
        state = str(progress.state)
        data = NavigationData(state, number, progress.reason, progress.distance_m, progress.time_s)
        ended = tuple(
            GoalResult(self._numbers.pop(goal.goal, 0), str(goal.end), goal.reason) for goal in done.ended
        )
        path = PathData() if planned is None else PathData(*_points(planned))
        arrival = self._watch_arrival(now_s, ended)
        return Stepped(now_s, done.twist, data, ended, path if is_new else None, arrival)

    def _watch_arrival(self, now_s: float, ended: tuple[GoalResult, ...]) -> ArrivalData | None:
        """What is newly thought of the last goal that was reached."""
        report, odometry = None if self._finder is None else self._finder.report, self._odometry
        if report is None or odometry is None:
            return None
        placed = None if report.map_from_odom is None else _pose2d(report.map_from_odom)
        reached = [goal.goal for goal in ended if goal.end == "reached"]
        if reached and placed is not None:
            self._arrival = begin_arrival(reached[-1], placed, odometry.odom_from_base)
        if self._arrival is None:
            return None
        self._arrival, changed = watch_arrival(
            self._arrival, now_s, placed, odometry.odom_from_base,
            is_sure=report.state is PoseState.LOCALIZED, is_uncertain=report.state is PoseState.UNCERTAIN,
        )  # fmt: skip
        return changed

    def _has_changed(self, stepped: Stepped) -> bool:
        last, data = None if self._last is None else self._last.now, stepped.now
        return last is None or (last.state, last.goal, last.reason) != (data.state, data.goal, data.reason)

    # the map

    def _follow_map(self) -> None:
        """Use the map that localization uses, with the zones that are drawn on it."""
        used = None if self._finder is None else self._finder.used
        if self._finder is not None and self._finder.has_freed_map:
            self._navigator.free_map()
        edited_before, self._edited = self._edited, None if self._finder is None else self._finder.edited
        if used is self._used:
            if self._edited is not edited_before and self._navigator.world is not None:
                self._use_zones(is_same_map=True)
            return
        before, self._used = self._used, used
        edited = self._edited
        if before is not None and used is not None and before[0] != used[0]:
            if edited is not None and edited is edited_before:  # renamed: the same map, with the same zones
                self._map = used if self._map is not None else None
                return
            self._navigator.fail(f"the map was changed from {before[0]} to {used[0]}")
        self._map, self._problem, self._map_from_odom, self._arrival = used, "", None, None
        if used is None or edited is None:
            self._map = None
            self._navigator.fail("there is no map in use any more")
            return
        self._use_zones()

    def _use_zones(self, *, is_same_map: bool = False) -> None:
        """Plan on the map that localization uses, with its zones as they are on the disk now.

        Where it is the map that was navigated on before, what was seen is remembered.
        """
        used, edited = self._used, self._edited
        if used is None or edited is None:
            return
        self._map, self._problem = used, ""
        try:
            zones = read_zones(self._folder, used[0])
            require_affordable(zones, GridFrame.of(edited.grid))
        except (ValueError, Refused) as problem:  # where not to go is not known: go nowhere
            self._map, self._problem = None, f"the zones of the map cannot be read: {problem}"
            if not is_same_map:  # what was navigated on before is another one
                self._navigator.free_map()
            self._navigator.fail(self._problem)
            return
        use = self._navigator.redraw_map if is_same_map else self._navigator.use_map
        use(edited.grid, zones, edited.closed)

    def _examined(self, request: requests.Examine) -> requests.Examined:
        """What these zones or edits would do to the robot, to places and to the way there."""
        world, used, edited = self._navigator.world, self._used, self._edited
        if world is None or used is None or edited is None:
            return requests.Examined(())
        try:
            if request.edits is not None:
                edited = edited_map(edited.stored, request.edits)
            if request.zones is not None:
                zones = parse_zones(request.zones.decode(), ZONES)
            else:
                zones = read_zones(self._folder, used[0])
            require_affordable(zones, GridFrame.of(edited.grid))
        except ValueError as error:
            raise Refused(RefusalKind.OUT_OF_RANGE, str(error)) from error
        pose, status = self._pose(self._clock.now_s())
        robot = None if pose is None or status is PoseStatus.LOST else (pose.x_m, pose.y_m)
        after = ground_costs(self._params, edited.grid, zones, edited.closed)
        covers = COVERED_BY_EDITS if request.zones is None else COVERED_BY_ZONES
        return requests.Examined(
            tuple(find_concerns(world.ground, after, robot, request.places, covers=covers))
        )


def read_zones(folder: FilePath, name: str) -> Zones:
    """The zones beside a stored map; none where there is no file.

    Raises:
        ValueError, Refused: it cannot be read, or holds no zones.
    """
    content = MapStore(folder, 1).read_beside(name, ZONES)
    return NO_ZONES if content is None else parse_zones(content.decode("utf-8"), ZONES)


def expect_odometry(odometry: OdometryUpdated, at_s: float) -> Floats:
    """Where odometry would say that the robot is, if it moves on as it did: a board that is silent obeys nothing."""
    after_s = min(max(at_s - odometry.stamp_s, 0.0), MOST_AGE_S)
    turned, moved = odometry.twist.angular_rad_s * after_s, odometry.twist.linear_m_s * after_s
    on = np.array([moved * np.cos(turned / 2), moved * np.sin(turned / 2), turned])
    return compose(row_of(odometry.odom_from_base), on)


def _outline(parameters: NavigationSkillParameters) -> Footprint:
    if parameters.radius_m is not None:
        return Footprint(radius_m=parameters.radius_m)
    x, y = parameters.half_length_m, parameters.half_width_m
    return Footprint(corners_m=((x, y), (-x, y), (-x, -y), (x, -y)))


def _goal(asked: GoalAsked) -> Goal:
    return Goal(asked.x_m, asked.y_m, asked.heading_rad, asked.tolerance_m, asked.max_speed_m_s)


def _pose2d(pose: Floats) -> Pose2D:
    return Pose2D(float(pose[0]), float(pose[1]), float(pose[2]))


def _points(path: Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    points = path.in_map()
    return tuple(points[:, 0].tolist()), tuple(points[:, 1].tolist())
