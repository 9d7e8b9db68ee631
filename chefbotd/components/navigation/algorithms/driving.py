"""One step along a trip: whether pose and scans are there, the surroundings, the allowed speed, the follower's twist."""

import math
from typing import Final

from chefbotd.components.navigation.algorithms.follower import follow
from chefbotd.components.navigation.algorithms.grid import Floats
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.steering import Control, Followed, Track, predict_pose
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.navigation.algorithms.trips import Trip
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

SCAN_FAULT_S: Final = 10.0
"""The goal ends after so much longer without a scan."""

POSE_SILENT_S: Final = 0.4
"""With older odometry the robot is commanded to stand: a board that was silent must not continue its last motion."""

LOST_S: Final = 20.0
"""A robot whose pose is lost stands, and the goal ends after so long."""

BRAKING_S = 0.05
"""The wheels have nearly stopped so long after the delay."""

POSE_LATE_S: Final = 0.2
"""With older odometry the robot drives more slowly."""

UNCERTAIN_SPEED_M_S: Final = 0.12
"""It drives no faster with an uncertain pose."""

TRIED_S = 0.05
"""The length of a first step that is only tried."""


class Missing(Record, frozen=True):
    """Since when the pose is lost, and for how long scans are missing; None: they are not.

    The time without scans is counted by steps: the time that a computer slept does not count.
    """

    lost_since_s: float | None = None
    without_scan_s: float | None = None
    brakes_until_s: float = -math.inf
    """After silent odometry the robot first stands: the board continued its last motion."""


class InputCheck(Record, frozen=True):
    """What is missing now, why the robot stands ("": it can drive), and how the goal ends if it was missing too long.

    ``is_over``: something was missing at the last step, and nothing is now.
    """

    missing: Missing
    stands: str = ""
    end: End | None = None
    reason: str = ""
    is_over: bool = False


def checked_inputs(
    params: NavigationParameters, last: Missing, inputs: StepInput, scan_stamp_s: float
) -> InputCheck:
    """One step, with the time of the last scan."""
    if inputs.status is PoseStatus.LOST:
        return _lost(params, last, inputs)
    was_missing = last.lost_since_s is not None or last.brakes_until_s > -math.inf
    if inputs.now_s - scan_stamp_s < params.scan_silent_s:
        until_s = last.brakes_until_s
        if inputs.pose_age_s >= POSE_SILENT_S:
            until_s = inputs.now_s + params.follower.delay_s + BRAKING_S
        if inputs.now_s < until_s:
            return InputCheck(
                Missing(brakes_until_s=until_s),
                Sentence("navigation.no_odometry", "waits, because no odometry arrives"),
            )
        return InputCheck(Missing(), is_over=was_missing or last.without_scan_s is not None)
    without_scan_s = inputs.dt_s + (last.without_scan_s or 0.0)
    missing, stands = (
        Missing(without_scan_s=without_scan_s),
        Sentence("navigation.no_scan", "waits, because no scan arrives"),
    )
    if without_scan_s < SCAN_FAULT_S:
        return InputCheck(missing, stands, is_over=was_missing)
    reason = Sentence(
        "navigation.scan_fault", "fault: no scan arrived for {seconds:.0f} s", seconds=SCAN_FAULT_S
    )
    return InputCheck(missing, stands, End.FAULT, reason, is_over=was_missing)


def _lost(params: NavigationParameters, last: Missing, inputs: StepInput) -> InputCheck:
    since_s = inputs.now_s if last.lost_since_s is None else last.lost_since_s
    missing, stands = (
        Missing(lost_since_s=since_s),
        Sentence("navigation.pose_not_known", "waits, because its pose is not known"),
    )
    if inputs.now_s - since_s < LOST_S:
        return InputCheck(missing, stands)
    reason = Sentence(
        "navigation.lost_pose",
        "lost: for {seconds:.0f} s the pose of the robot was not known",
        seconds=LOST_S,
    )
    return InputCheck(missing, stands, End.LOST, reason)


def find_surroundings(params: NavigationParameters, world: WorldModel, inputs: StepInput) -> Surroundings:
    """What is around the robot at the pose where the next twist takes effect."""
    pose = predict_pose(params.follower, world.frame.pose_to_grid(inputs.pose), inputs.last)
    return world.surroundings(pose, inputs.now_s, inputs.last.linear_m_s)


def follow_trip(
    params: NavigationParameters,
    world: WorldModel,
    trip: Trip,
    inputs: StepInput,
    surroundings: Surroundings,
    points_m: Floats | None = None,
) -> Followed:
    """The next twist along the trip; ``points_m`` lead through the middle of a tight passage, a little beside it."""
    goal, heading_rad = trip.path.goal, None
    if goal.heading_rad is not None:
        end = Pose2D(goal.x_m, goal.y_m, goal.heading_rad)
        heading_rad = trip.path.frame.pose_to_grid(end).heading_rad
    limit_m_s = speed_limit_m_s(params, world, inputs, surroundings.grid_from_base)
    if goal.max_speed_m_s is not None:
        limit_m_s = min(limit_m_s, goal.max_speed_m_s)
    track = Track(
        trip.path.points_m if points_m is None else points_m, heading_rad, limit_m_s, points_m is not None
    )
    control = Control(params.follower, params.outline, surroundings, inputs.last, inputs.dt_s)
    return follow(control, trip.follow, track)


def can_begin(
    params: NavigationParameters, world: WorldModel, trip: Trip, inputs: StepInput, surroundings: Surroundings
) -> bool:
    """Whether nothing is in the way of the trip's first step."""
    tried = replace(inputs, status=PoseStatus.LOCALIZED, dt_s=TRIED_S)
    return not follow_trip(params, world, trip, tried, surroundings).is_blocked


def speed_limit_m_s(
    params: NavigationParameters, world: WorldModel, inputs: StepInput, pose: Pose2D
) -> float:
    """What zones, an uncertain pose, late scans and late odometry allow at a pose of the grid's frame."""
    cell = world.frame.cell(pose.x_m, pose.y_m)
    limit_m_s = math.inf if cell is None else float(world.ground.speed_limit_m_s[cell])
    if inputs.status is PoseStatus.UNCERTAIN:
        limit_m_s = min(limit_m_s, UNCERTAIN_SPEED_M_S)
    most_m_s, age_s = params.follower.max_speed_m_s, inputs.now_s - world.scan_stamp_s
    by_scan = _late_share(age_s, params.scan_late_s, params.scan_silent_s)
    by_pose = _late_share(inputs.pose_age_s, POSE_LATE_S, POSE_SILENT_S)
    return min(limit_m_s, most_m_s * min(by_scan, by_pose))


def _late_share(age_s: float, late_s: float, silent_s: float) -> float:
    """The share of the speed with an input of this age, down to 0 when the input counts as missing."""
    return math.inf if age_s <= late_s else max((silent_s - age_s) / (silent_s - late_s), 0.0)
