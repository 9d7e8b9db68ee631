"""Executes one goal from its acceptance to its end: plans, drives, and recovers.

Poses are ``map_from_base``.
"""

import math
from typing import Final

from chefbotd.components.navigation.algorithms.costmap import UNMAPPED_MARGIN_M
from chefbotd.components.navigation.algorithms.driving import (
    LOST_S,
    Missing,
    checked_inputs,
    follow_trip,
)
from chefbotd.components.navigation.algorithms.evasion import Evasion, evade, evasion_sentence
from chefbotd.components.navigation.algorithms.goal_recovery import GoalRecovery, RecoveryStep
from chefbotd.components.navigation.algorithms.goal_search import GoalSearch
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.noise import noise_sentence
from chefbotd.components.navigation.algorithms.passage import Passages, place_to_close
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Planner
from chefbotd.components.navigation.algorithms.recovery import (
    CLOSED_RADIUS_M,
    InTheWay,
    LastProgress,
    checked_progress,
)
from chefbotd.components.navigation.algorithms.states import End, GoalEvent, GoalState, next_state
from chefbotd.components.navigation.algorithms.steering import Followed, Phase
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.navigation.algorithms.trips import (
    REPLAN_S,
    Choice,
    Trip,
    Waiting,
    choice,
    is_due,
    stands_at_goal,
    waiting,
)
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence, join_sentences

RENEWED_M: Final = 0.5
"""A goal that replaces one so near to it is the same one renewed, as by a program that follows somebody."""


MOST_NARROW: Final = 3
"""So many passages that are too narrow end a goal."""

NARROW_S: Final = 600.0
"""A passage that was measured as too narrow is closed for so long."""

BEFORE_GOAL_M: Final = 0.15
"""A wall that stops the robot so near to its goal belongs to the goal, and not to the way there."""

UNSURE_S: Final = 12.0
"""At the goal the robot waits so long until it is sure of its pose."""

CORRECTED_M: Final = 0.1
"""A pose that was corrected by more takes the robot away from its goal."""

HELD_BY_WALL: Final = 3
"""After so many approaches that a guard held back before a wall of the map, the goal ends."""

AT_GOAL: Final = (Phase.APPROACHING, Phase.FINAL_TURN)


def unreachable(why: str) -> Sentence:
    """How a goal ends to which there is no path."""
    return Sentence("navigation.unreachable", "unreachable: {why}", why=why)


def beside_something(why: str, place: str) -> str:
    """Why the robot is stuck, with the place of what stands beside it; without one only why."""
    if not place:
        return why
    return Sentence("navigation.beside", "{why} beside something{place}", why=why, place=place)


class GoalExecution:
    """Holds what the pure steps take and return for one goal; ``reason`` says what is done, ``ended`` how it ended."""

    def __init__(
        self, params: NavigationParameters, planner: Planner, goal: Goal, state: GoalState, reason: str
    ) -> None:
        self._search = GoalSearch(params, planner, goal)
        self._recovery = GoalRecovery(self._search)
        self.state, self.reason = state, reason
        self._has_to_rest = False
        self.ended: tuple[End, str] | None = None
        self.trip: Trip | None = None
        self._missing = Missing()
        self._unsure_since_s: float | None = None
        self._last_progress = LastProgress(-math.inf, Pose2D())
        self._evasion = Evasion()
        self._is_blocked = False
        self._waiting: Waiting | None = None
        self._is_renewed = self._was_turning = False
        self._noise = ""
        self._passages, self._narrow = Passages(), 0  # those measured; how many were too narrow

    @property
    def _params(self) -> NavigationParameters:
        return self._search.params

    @property
    def _goal(self) -> Goal:
        return self._search.goal

    def use(self, params: NavigationParameters, *, has_to_rest: bool) -> None:
        """Go on with these; with ``has_to_rest`` the robot is still on its way, and has not arrived yet."""
        self._search.params, self._has_to_rest = params, has_to_rest

    def retarget(self, goal: Goal) -> bool:
        """Go on to a goal that replaced this one; whether it is about the same place.

        The robot drives on until the new path is found. What was tried to reach the same place counts further.
        """
        self._is_renewed = math.dist((goal.x_m, goal.y_m), (self._goal.x_m, self._goal.y_m)) <= RENEWED_M
        self._was_turning = self.trip is not None and self.trip.follow.phase is Phase.TURNING
        self._search.search_other(goal, is_renewed=self._is_renewed)
        if not self._is_renewed:
            self._recovery.forget()
            self._evasion, self._waiting = Evasion(), None
        if not self._is_renewed or self.state is not GoalState.RECOVERING:
            self._change(GoalEvent.GOAL_REPLACED)
        return self._is_renewed

    def pause(self, reason: str) -> None:
        """Stand; what follows is a new execution."""
        if self.state is not GoalState.PAUSED:
            self._change(GoalEvent.PAUSED)
        self.reason = reason

    def end(self, end: End, reason: str) -> None:
        """The goal has ended so."""
        self._change(GoalEvent.GOAL_ENDED)
        self.ended = (end, reason)

    def forget_path(self) -> None:
        """Plan again: there is another map, or the pose was wrong."""
        self.trip = None
        self._recovery.forget_tries()
        if self.state in (GoalState.DRIVING, GoalState.RECOVERING):
            self.state = GoalState.PLANNING

    def prepare(self, world: WorldModel, inputs: StepInput) -> bool:
        """Whether the robot can drive in this step: pose and scans are there, and a path, which is planned first."""
        self._noise = noise_sentence(world.noise_share)
        if not self._has_input(world, inputs):
            return False
        if self.state is GoalState.PLANNING:
            self._plan(world, inputs)
        return self.ended is None and self.state is not GoalState.PLANNING

    def drive(self, world: WorldModel, inputs: StepInput, surroundings: Surroundings) -> Twist2D | None:
        """The twist to drive, or to recover, with; None is standing."""
        self._is_blocked = False
        if self.state is GoalState.RECOVERING and self._recovery.has_begun:
            done = self._recovery.step(world, inputs, surroundings, self.trip, self._noise)
            self._go_on(done, inputs)
            return done.twist
        return self._drive(world, inputs, surroundings)

    def evade(self, inputs: StepInput, surroundings: Surroundings, twist: Twist2D | None) -> Twist2D | None:
        """The same twist or, while the robot stands, one that evades a person."""
        arrives = self.trip is not None and self.trip.follow.phase in AT_GOAL and not self.trip.is_interim
        was_said, was_used_up = self._evasion.who is not None, self._evasion.is_used_up
        self._evasion, twist = evade(
            self._params, self._evasion, inputs, surroundings, twist,
            is_blocked=self._is_blocked, arrives=arrives, waits=self._waiting is not None,
        )  # fmt: skip
        is_new = not was_said or was_used_up is not self._evasion.is_used_up
        if self._evasion.who is not None and is_new:
            self.reason = self._makes_way(self._evasion.who)
        elif self._evasion.who is None and was_said and self.state is GoalState.DRIVING:
            self.reason = self._search.sentence
        return twist

    def _makes_way(self, who: tuple[float, float]) -> str:
        place = self.trip.path.frame.pose_to_map(Pose2D(*who)) if self.trip is not None else Pose2D(*who)
        return evasion_sentence(self._evasion, place)

    def _change(self, event: GoalEvent) -> None:
        self.state = next_state(self.state, event)

    def _has_input(self, world: WorldModel, inputs: StepInput) -> bool:
        """Whether pose and scans are there to plan and drive by."""
        check = checked_inputs(self._params, self._missing, inputs, world.scan_stamp_s)
        self._missing = check.missing
        if check.stands:
            self.reason = check.stands
        elif check.is_over and self.state is GoalState.DRIVING:
            self.reason = self._search.sentence
        if check.end is not None:
            self.end(check.end, check.reason)
        return not check.stands

    # Planning

    def _plan(self, world: WorldModel, inputs: StepInput) -> None:
        if self._unsure_since_s is not None and inputs.now_s - self._search.planned_s < REPLAN_S:
            return
        trip = self._search.find_or_look(world, inputs)
        if isinstance(trip, Trip):
            self._set_out(trip, inputs)
        elif trip.only_for_now:
            self._become_stuck(world, inputs, trip.reason)
        elif inputs.status is PoseStatus.UNCERTAIN:
            self._doubt(trip, inputs)
        else:
            why = join_sentences((trip.reason, *self._search.standing_sentences))
            self.end(End.UNREACHABLE, unreachable(why))

    def _look_at(self, world: WorldModel, inputs: StepInput, *, has_arrived: bool) -> bool:
        """Whether the robot goes on looking, or plans again by what it saw."""
        is_looking = self._search.is_looking
        if self._search.ends_look(world, inputs, has_arrived=has_arrived):
            self.forget_path()
        return is_looking

    def _doubt(self, no_path: NoPath, inputs: StepInput) -> None:
        """There is no path from a pose that may be wrong: plan again when the pose is sure."""
        if self._unsure_since_s is None:
            self._unsure_since_s = inputs.now_s
        self.reason = Sentence(
            "navigation.waits_unsure", "waits, because it is not sure of its pose: {why}", why=no_path.reason
        )
        if inputs.now_s - self._unsure_since_s >= LOST_S:
            lost = Sentence(
                "navigation.lost_unsure",
                "lost: for {seconds:.0f} s the pose of the robot was uncertain: {why}",
                seconds=LOST_S,
                why=no_path.reason,
            )
            self.end(End.LOST, lost)

    def _set_out(self, trip: Trip, inputs: StepInput) -> None:
        self._change(GoalEvent.PATH_FOUND)
        self._unsure_since_s = None
        if self._was_turning:
            trip = replace(trip, follow=replace(trip.follow, phase=Phase.TURNING))
        if not self._is_renewed:
            self._last_progress = LastProgress(inputs.now_s, inputs.pose)
        self._is_renewed = self._was_turning = False
        self.trip, self.reason = trip, self._search.sentence

    def _replan(self, world: WorldModel, trip: Trip, inputs: StepInput, surroundings: Surroundings) -> None:
        """Take a better path, or one round what blocks the present one."""
        if not is_due(self._params, trip, self._search.planned_s, inputs.now_s):
            return
        other = self._search.find(world, inputs)
        chosen = choice(self._params, world.planned_costs, trip, other, inputs, surroundings)
        if isinstance(other, Trip) and chosen is Choice.TAKE_NEW:
            since_s = inputs.now_s if self._waiting is None else self._waiting.since_s
            self._wait(waiting(self._params, world, trip, other, since_s, inputs.now_s), inputs)
            if self._waiting is None:
                self._set_out(other, inputs)
            return
        self._wait(None, inputs)
        if isinstance(other, NoPath) and chosen is Choice.STUCK:
            self._become_stuck(world, inputs, other.reason)

    def _wait(self, wait: Waiting | None, inputs: StepInput) -> None:
        """Wait for a person on the path, or no longer: waiting is no lack of progress."""
        if wait is not None:
            self.reason = wait.reason
        elif self._waiting is not None:
            self.reason = self._search.sentence
        if wait is not None or self._waiting is not None:
            self._last_progress = LastProgress(inputs.now_s, inputs.pose)
        self._waiting = wait

    # Driving

    def _drive(self, world: WorldModel, inputs: StepInput, surroundings: Surroundings) -> Twist2D | None:
        self._look_at(world, inputs, has_arrived=False)
        if self.trip is not None:
            self._replan(world, self.trip, inputs, surroundings)
        trip = self.trip
        if self.state is not GoalState.DRIVING or trip is None:
            return None
        self._passages.add_scan(self._params.outline, world.walls_seen_m, trip.left, world.scan_stamp_s)
        done = follow_trip(self._params, world, trip, inputs, surroundings, self._passages.centred(trip.path))
        self._is_blocked = done.is_blocked
        if done.state.phase is Phase.DONE and self._has_to_rest:
            return None
        self.trip = trip = Trip(trip.path, done.state, trip.is_interim)
        if done.state.phase is Phase.DONE:
            self._arrive(world, trip, inputs)
            return None
        world.remember_drive(surroundings.grid_from_base, done.twist)
        self._judge(world, done, inputs, surroundings)
        return done.twist if self.state is GoalState.DRIVING else None

    def _arrive(self, world: WorldModel, trip: Trip, inputs: StepInput) -> None:
        if self._look_at(world, inputs, has_arrived=True):
            return
        if trip.is_interim:
            why = stands_at_goal(self._goal)
            self._become_stuck(world, inputs, why)
            return
        if self._waits_until_sure(inputs):
            return
        reached: str = Sentence(
            "navigation.reached", "reached ({x_m:.2f}, {y_m:.2f})", x_m=inputs.pose.x_m, y_m=inputs.pose.y_m
        )
        if trip.path.is_substitute:
            reached = Sentence(
                "navigation.reached_nearest",
                "{reached}, the nearest free place within the tolerance",
                reached=reached,
            )
        if inputs.status is PoseStatus.UNCERTAIN:
            reached = Sentence(
                "navigation.reached_unsure",
                "{reached}, by a pose that was uncertain for {seconds:.0f} s",
                reached=reached,
                seconds=UNSURE_S,
            )
        self.end(End.REACHED, reached)

    def _waits_until_sure(self, inputs: StepInput) -> bool:
        """Whether the robot stands at its goal by a pose that may be wrong, or plans again since that was corrected."""
        if inputs.status is not PoseStatus.UNCERTAIN:
            left_m = math.hypot(self._goal.x_m - inputs.pose.x_m, self._goal.y_m - inputs.pose.y_m)
            was_wrong = self._unsure_since_s is not None and left_m > self._goal.tolerance_m + CORRECTED_M
            self._unsure_since_s = None
            if was_wrong:
                self.forget_path()
            return was_wrong
        if self._unsure_since_s is None:
            self._unsure_since_s = inputs.now_s
            self.reason = Sentence(
                "navigation.waits_at_goal", "has come to its goal, and waits until it is sure of its pose"
            )
        return inputs.now_s - self._unsure_since_s < UNSURE_S

    @property
    def is_unsure_at_goal(self) -> bool:
        """Whether it waits at its goal until the pose is sure."""
        has_come = self.trip is not None and self.trip.follow.phase is Phase.DONE
        return has_come and self._unsure_since_s is not None

    def _judge(
        self, world: WorldModel, done: Followed, inputs: StepInput, surroundings: Surroundings
    ) -> None:
        """Whether it has been blocked, or has not come on, for too long."""
        in_the_way = None
        if done.is_blocked:
            where = world.nearest_ahead(surroundings, done.turns_rad)
            in_the_way = InTheWay(where, world.meets_walker(surroundings.grid_from_base))
        check = checked_progress(self._params, self._last_progress, inputs, in_the_way)
        self._last_progress = check.progress
        at_goal = done.state.phase is Phase.APPROACHING and (check.stuck or done.state.held >= HELD_BY_WALL)
        left_m = math.hypot(self._goal.x_m - inputs.pose.x_m, self._goal.y_m - inputs.pose.y_m)
        if at_goal and left_m < BEFORE_GOAL_M and (wall := world.wall_beside(surroundings)):
            self._end_before_wall(wall, inputs)
            return
        if self._waiting is not None:
            return
        if check.waits or check.drives_again:
            self.reason = check.waits or self._search.sentence
        if self._leave_narrow(world, inputs):
            return
        if check.stuck:
            place = "" if done.is_blocked else world.beside(surroundings)
            self._become_stuck(world, inputs, beside_something(check.stuck, place))

    def _end_before_wall(self, wall: str, inputs: StepInput) -> None:
        """Nobody can clear a wall of the map out of the way."""
        goal, pose = self._goal, inputs.pose
        left_m = math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)
        blocked = Sentence(
            "navigation.wall_at_goal",
            "blocked: the wall of the map{wall} is too near to the goal ({goal_x_m:.2f}, {goal_y_m:.2f}) for the "
            "obstacle guards, which stop the robot {left_m:.2f} m from it, at ({x_m:.2f}, {y_m:.2f})",
            wall=wall,
            goal_x_m=goal.x_m,
            goal_y_m=goal.y_m,
            left_m=left_m,
            x_m=pose.x_m,
            y_m=pose.y_m,
        )
        self.end(End.BLOCKED, blocked)

    def _leave_narrow(self, world: WorldModel, inputs: StepInput) -> bool:
        """Whether a passage on the path is too narrow for the robot: it takes another way, or the goal ends."""
        passage = None if self.trip is None else self._passages.too_narrow(self.trip.left)
        if passage is None or self.trip is None:
            return False
        place, self._passages = passage.middle, Passages()
        apart_m = self._params.outline.outer_radius_m + UNMAPPED_MARGIN_M + 2 * CLOSED_RADIUS_M
        world.close(place_to_close(self.trip.left, place, apart_m), inputs.now_s + NARROW_S)
        other = self._search.find(world, inputs)
        self._narrow += 1
        if isinstance(other, Trip) and self._narrow < MOST_NARROW:
            self._set_out(other, inputs)
            return True
        at, width_m = world.frame.pose_to_map(place), passage.width_m
        blocked = Sentence(
            "navigation.narrow",
            "blocked: the passage at ({x_m:.2f}, {y_m:.2f}) is {width_m:.2f} m wide, and the robot needs "
            "{needed_m:.2f} m",
            x_m=at.x_m,
            y_m=at.y_m,
            width_m=width_m,
            needed_m=passage.needed_m,
        )
        self.end(End.BLOCKED, blocked)
        return True

    # Recovering

    def _become_stuck(self, world: WorldModel, inputs: StepInput, why: str) -> None:
        left_m = math.hypot(self._goal.x_m - inputs.pose.x_m, self._goal.y_m - inputs.pose.y_m)
        if self.trip is not None:
            left_m = self.trip.left.length_m
        done = self._recovery.start(world, inputs, why, left_m, self.trip, self._noise)
        if done.end is None:
            self._change(GoalEvent.STUCK)
        self._go_on(done, inputs)

    def _go_on(self, done: RecoveryStep, inputs: StepInput) -> None:
        """Set out on the path that was found, end, or go on recovering."""
        if done.end is not None:
            self.end(done.end, done.reason)
        elif done.trip is not None:
            self._set_out(done.trip, inputs)
        elif done.reason:
            self.reason = done.reason
