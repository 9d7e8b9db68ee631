"""Executes one goal from its acceptance to its end: plans, drives, and recovers.

Poses are ``map_from_base``.
"""

import math
from typing import Final

from chefbotd.components.navigation.algorithms.costmap import UNMAPPED_MARGIN_M
from chefbotd.components.navigation.algorithms.driving import (
    LOST_S,
    Missing,
    can_begin,
    checked_inputs,
    follow_trip,
)
from chefbotd.components.navigation.algorithms.evasion import Evasion, evade
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.looking import (
    LOOKS_S,
    MOST_LOOKS,
    Look,
    in_the_way,
    look_out,
    place_of,
)
from chefbotd.components.navigation.algorithms.noise import noise_sentence
from chefbotd.components.navigation.algorithms.passage import Passages, place_to_close
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Planner
from chefbotd.components.navigation.algorithms.recovery import (
    AGAIN_S,
    CLOSED_RADIUS_M,
    CLOSED_S,
    SENTENCES,
    Action,
    InTheWay,
    LastProgress,
    Recovery,
    after,
    back_out,
    checked_progress,
    is_over,
    start_recovery,
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
    find,
    is_due,
    waiting,
)
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace

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


class GoalExecution:
    """Holds what the pure steps take and return for one goal; ``reason`` says what is done, ``ended`` how it ended."""

    def __init__(
        self, params: NavigationParameters, planner: Planner, goal: Goal, state: GoalState, reason: str
    ) -> None:
        self._params, self._planner, self._goal = params, planner, goal
        self.state, self.reason = state, reason
        self._has_to_rest = False
        self.ended: tuple[End, str] | None = None
        self.trip: Trip | None = None
        self._planned_s = -math.inf
        self._missing = Missing()
        self._unsure_since_s: float | None = None
        self._last_progress = LastProgress(-math.inf, Pose2D())
        self._evasion = Evasion()
        self._is_blocked = False
        self._waiting: Waiting | None = None
        self._is_renewed = self._was_turning = False
        self._recovery: Recovery | None = None
        self._look = Look()
        self._why_stuck = self._noise = ""
        self._passages, self._narrow = Passages(), 0  # those measured; how many were too narrow
        self._backed_from = Pose2D()

    def use(self, params: NavigationParameters, *, has_to_rest: bool) -> None:
        """Go on with these; with ``has_to_rest`` the robot is still on its way, and has not arrived yet."""
        self._params, self._has_to_rest = params, has_to_rest

    def retarget(self, goal: Goal) -> bool:
        """Go on to a goal that replaced this one; whether it is about the same place.

        The robot drives on until the new path is found. What was tried to reach the same place counts further.
        """
        self._is_renewed = math.dist((goal.x_m, goal.y_m), (self._goal.x_m, self._goal.y_m)) <= RENEWED_M
        self._was_turning = self.trip is not None and self.trip.follow.phase is Phase.TURNING
        self._goal = goal
        if not self._is_renewed:
            self._recovery, self._evasion, self._waiting, self._why_stuck = None, Evasion(), None, ""
            self._look = Look()
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
        self.trip, self._recovery = None, None
        if self.state in (GoalState.DRIVING, GoalState.RECOVERING):
            self.state = GoalState.PLANNING

    def prepare(self, world: WorldModel, now: StepInput) -> bool:
        """Whether the robot can drive in this step: pose and scans are there, and a path, which is planned first."""
        self._noise = noise_sentence(world.noise_share)
        if not self._has_input(world, now):
            return False
        if self.state is GoalState.PLANNING:
            self._plan(world, now)
        return self.ended is None and self.state is not GoalState.PLANNING

    def drive(self, world: WorldModel, now: StepInput, near: Surroundings) -> Twist2D | None:
        """The twist to drive, or to recover, with; None is standing."""
        self._is_blocked = False
        if self.state is GoalState.RECOVERING and self._recovery is not None:
            return self._recover(world, self._recovery, now, near)
        return self._drive(world, now, near)

    def evade(self, now: StepInput, near: Surroundings, twist: Twist2D | None) -> Twist2D | None:
        """The same twist or, while the robot stands, one that evades a person."""
        arrives = self.trip is not None and self.trip.follow.phase in AT_GOAL and not self.trip.is_interim
        was_said, was_used_up = self._evasion.who is not None, self._evasion.is_used_up
        self._evasion, twist = evade(
            self._params, self._evasion, now, near, twist,
            is_blocked=self._is_blocked, arrives=arrives, waits=self._waiting is not None,
        )  # fmt: skip
        is_new = not was_said or was_used_up is not self._evasion.is_used_up
        if self._evasion.who is not None and is_new:
            self.reason = self._makes_way(self._evasion.who)
        elif self._evasion.who is None and was_said and self.state is GoalState.DRIVING:
            self.reason = self._drives()
        return twist

    def _makes_way(self, who: tuple[float, float]) -> str:
        place = self.trip.path.frame.pose_to_map(Pose2D(*who)) if self.trip is not None else Pose2D(*who)
        where = f"somebody at ({place.x_m:.2f}, {place.y_m:.2f})"
        if not self._evasion.is_used_up:
            return f"makes way for {where}"
        return (
            f"stands for {where}: it has made way for {self._evasion.evaded_m:.0f} m on the way to this goal"
        )

    def _change(self, event: GoalEvent) -> None:
        self.state = next_state(self.state, event)

    def _has_input(self, world: WorldModel, now: StepInput) -> bool:
        """Whether pose and scans are there to plan and drive by."""
        inputs = checked_inputs(self._params, self._missing, now, world.scan_stamp_s)
        self._missing = inputs.missing
        if inputs.stands:
            self.reason = inputs.stands
        elif inputs.is_over and self.state is GoalState.DRIVING:
            self.reason = self._drives()
        if inputs.end is not None:
            self.end(inputs.end, inputs.reason)
        return not inputs.stands

    # Planning

    def _find(self, world: WorldModel, now: StepInput, *, with_closed: bool = True) -> Trip | NoPath:
        self._planned_s = now.now_s
        here = world.frame.pose_to_grid(now.pose)
        costs = world.costs_to_plan(now.now_s, here, with_closed=with_closed)
        params = self._params
        return find(self._planner, params.outline, costs, world.ground, now.pose, self._goal)

    def _plan(self, world: WorldModel, now: StepInput) -> None:
        if self._unsure_since_s is not None and now.now_s - self._planned_s < REPLAN_S:
            return
        trip = self._find(world, now)
        if isinstance(trip, NoPath) and not trip.only_for_now and world.open_gone():
            trip = self._find(world, now)
        if isinstance(trip, Trip):
            self._set_out(trip, now)
        elif trip.only_for_now:
            self._become_stuck(world, now, trip.reason)
        elif self._goes_to_look(world, now):
            return
        elif now.status is PoseStatus.UNCERTAIN:
            self._doubt(trip, now)
        else:
            outcome = "".join(
                f"; it went to look: something still stands at {place}" for place in self._look.standing
            )
            self.end(End.UNREACHABLE, f"unreachable: {trip.reason}{outcome}")

    def _goes_to_look(self, world: WorldModel, now: StepInput) -> bool:
        """Whether a thing of the map alone is in the way, and it can be seen whether that is still there."""
        look = self._look
        if now.status is not PoseStatus.LOCALIZED or len(look.looked_from) >= MOST_LOOKS:
            return False
        outline, planner = self._params.outline, self._planner
        thing = in_the_way(world, planner, outline, now, self._goal)
        trip = None if thing is None else look_out(world, planner, outline, now, thing, look)
        if thing is None or trip is None:
            return False
        self._look = replace(look, thing=thing, place=place_of(world, thing), since_s=None)
        self._set_out(trip, now)
        self.reason = self._look.reason
        return True

    def _look_at(self, world: WorldModel, now: StepInput, *, has_arrived: bool) -> bool:
        """Whether the robot goes on looking; else it plans again, by what it saw."""
        look, here = self._look, world.frame.pose_to_grid(now.pose)
        if look.thing is None:
            return False
        since_s = now.now_s if look.since_s is None else look.since_s
        is_over = world.is_there(look.thing) or (has_arrived and now.now_s - since_s >= LOOKS_S)
        if not is_over and not world.open_gone():
            self._look = replace(look, since_s=since_s) if has_arrived else look
            return True
        standing = (*look.standing, look.place) if world.is_there(look.thing) else look.standing
        self._look = Look(looked_from=(*look.looked_from, (here.x_m, here.y_m)), standing=standing)
        self.forget_path()
        return True

    def _doubt(self, no_path: NoPath, now: StepInput) -> None:
        """There is no path from a pose that may be wrong: plan again when the pose is sure."""
        if self._unsure_since_s is None:
            self._unsure_since_s = now.now_s
        self.reason = f"waits, because it is not sure of its pose: {no_path.reason}"
        if now.now_s - self._unsure_since_s >= LOST_S:
            why = f"for {LOST_S:.0f} s the pose of the robot was uncertain"
            self.end(End.LOST, f"lost: {why}: {no_path.reason}")

    def _set_out(self, trip: Trip, now: StepInput) -> None:
        self._change(GoalEvent.PATH_FOUND)
        self._unsure_since_s = None
        if self._was_turning:
            trip = replace(trip, follow=replace(trip.follow, phase=Phase.TURNING))
        if not self._is_renewed:
            self._last_progress = LastProgress(now.now_s, now.pose)
        self._is_renewed = self._was_turning = False
        self.trip, self.reason = trip, self._drives()

    def _drives(self) -> str:
        if self._look.thing is not None:
            return self._look.reason
        return f"drives to ({self._goal.x_m:.2f}, {self._goal.y_m:.2f})"

    def _replan(self, world: WorldModel, trip: Trip, now: StepInput, near: Surroundings) -> None:
        """Take a better path, or one round what blocks the present one."""
        if not is_due(self._params, trip, self._planned_s, now.now_s):
            return
        other = self._find(world, now)
        chosen = choice(self._params, world.planned_costs, trip, other, now, near)
        if isinstance(other, Trip) and chosen is Choice.TAKE_NEW:
            since_s = now.now_s if self._waiting is None else self._waiting.since_s
            self._wait(waiting(self._params, world, trip, other, since_s, now.now_s), now)
            if self._waiting is None:
                self._set_out(other, now)
            return
        self._wait(None, now)
        if isinstance(other, NoPath) and chosen is Choice.STUCK:
            self._become_stuck(world, now, other.reason)

    def _wait(self, wait: Waiting | None, now: StepInput) -> None:
        """Wait for a person on the path, or no longer: waiting is no lack of progress."""
        if wait is not None:
            self.reason = wait.reason
        elif self._waiting is not None:
            self.reason = self._drives()
        if wait is not None or self._waiting is not None:
            self._last_progress = LastProgress(now.now_s, now.pose)
        self._waiting = wait

    # Driving

    def _drive(self, world: WorldModel, now: StepInput, near: Surroundings) -> Twist2D | None:
        self._look_at(world, now, has_arrived=False)
        if self.trip is not None:
            self._replan(world, self.trip, now, near)
        trip = self.trip
        if self.state is not GoalState.DRIVING or trip is None:
            return None
        self._passages.add_scan(self._params.outline, world.walls_seen_m, trip.left, world.scan_stamp_s)
        done = follow_trip(self._params, world, trip, now, near, self._passages.centred(trip.path))
        self._is_blocked = done.is_blocked
        if done.state.phase is Phase.DONE and self._has_to_rest:
            return None
        self.trip = trip = Trip(trip.path, done.state, trip.is_interim)
        if done.state.phase is Phase.DONE:
            self._arrive(world, trip, now)
            return None
        world.remember_drive(near.grid_from_base, done.twist)
        self._judge(world, done, now, near)
        return done.twist if self.state is GoalState.DRIVING else None

    def _arrive(self, world: WorldModel, trip: Trip, now: StepInput) -> None:
        if self._look_at(world, now, has_arrived=True):
            return
        if trip.is_interim:
            why = f"something stands at the goal ({self._goal.x_m:.2f}, {self._goal.y_m:.2f})"
            self._become_stuck(world, now, why)
            return
        if self._waits_until_sure(now):
            return
        where = f"reached ({now.pose.x_m:.2f}, {now.pose.y_m:.2f})"
        if trip.path.is_substitute:
            where += ", the nearest free place within the tolerance"
        if now.status is PoseStatus.UNCERTAIN:
            where += f", by a pose that was uncertain for {UNSURE_S:.0f} s"
        self.end(End.REACHED, where)

    def _waits_until_sure(self, now: StepInput) -> bool:
        """Whether the robot stands at its goal by a pose that may be wrong, or plans again since that was corrected."""
        if now.status is not PoseStatus.UNCERTAIN:
            left_m = math.hypot(self._goal.x_m - now.pose.x_m, self._goal.y_m - now.pose.y_m)
            was_wrong = self._unsure_since_s is not None and left_m > self._goal.tolerance_m + CORRECTED_M
            self._unsure_since_s = None
            if was_wrong:
                self.forget_path()
            return was_wrong
        if self._unsure_since_s is None:
            self._unsure_since_s = now.now_s
            self.reason = "has come to its goal, and waits until it is sure of its pose"
        return now.now_s - self._unsure_since_s < UNSURE_S

    @property
    def is_unsure_at_goal(self) -> bool:
        """Whether it waits at its goal until the pose is sure."""
        has_come = self.trip is not None and self.trip.follow.phase is Phase.DONE
        return has_come and self._unsure_since_s is not None

    def _judge(self, world: WorldModel, done: Followed, now: StepInput, near: Surroundings) -> None:
        """Whether it has been blocked, or has not come on, for too long."""
        in_the_way = None
        if done.is_blocked:
            where = world.nearest_ahead(near, done.turns_rad)
            in_the_way = InTheWay(where, world.meets_walker(near.grid_from_base))
        check = checked_progress(self._params, self._last_progress, now, in_the_way)
        self._last_progress = check.progress
        at_goal = done.state.phase is Phase.APPROACHING and (check.stuck or done.state.held >= HELD_BY_WALL)
        left_m = math.hypot(self._goal.x_m - now.pose.x_m, self._goal.y_m - now.pose.y_m)
        if at_goal and left_m < BEFORE_GOAL_M and (wall := world.wall_beside(near)):
            self._end_before_wall(wall, now)
            return
        if self._waiting is not None:
            return
        if check.waits or check.drives_again:
            self.reason = check.waits or self._drives()
        if self._leave_narrow(world, now):
            return
        if check.stuck:
            beside = "" if done.is_blocked else world.beside(near)
            self._become_stuck(world, now, check.stuck + beside)

    def _end_before_wall(self, wall: str, now: StepInput) -> None:
        """Nobody can clear a wall of the map out of the way."""
        goal, pose = self._goal, now.pose
        left_m = math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)
        why = f"the wall of the map{wall} is too near to the goal ({goal.x_m:.2f}, {goal.y_m:.2f})"
        end = f"{why} for the obstacle guards, which stop the robot {left_m:.2f} m from it"
        self.end(End.BLOCKED, f"blocked: {end}, at ({pose.x_m:.2f}, {pose.y_m:.2f})")

    def _leave_narrow(self, world: WorldModel, now: StepInput) -> bool:
        """Whether a passage on the path is too narrow for the robot: it takes another way, or the goal ends."""
        passage = None if self.trip is None else self._passages.too_narrow(self.trip.left)
        if passage is None or self.trip is None:
            return False
        place, self._passages = passage.middle, Passages()
        apart_m = self._params.outline.outer_radius_m + UNMAPPED_MARGIN_M + 2 * CLOSED_RADIUS_M
        world.close(place_to_close(self.trip.left, place, apart_m), now.now_s + NARROW_S)
        other = self._find(world, now)
        self._narrow += 1
        if isinstance(other, Trip) and self._narrow < MOST_NARROW:
            self._set_out(other, now)
            return True
        at, width_m = world.frame.pose_to_map(place), passage.width_m
        where = f"the passage at ({at.x_m:.2f}, {at.y_m:.2f}) is {width_m:.2f} m wide"
        self.end(End.BLOCKED, f"blocked: {where}, and the robot needs {passage.needed_m:.2f} m")
        return True

    # Recovering

    def _become_stuck(self, world: WorldModel, now: StepInput, why: str) -> None:
        self._why_stuck = why
        left_m = math.hypot(self._goal.x_m - now.pose.x_m, self._goal.y_m - now.pose.y_m)
        if self.trip is not None:
            left_m = self.trip.left.length_m
        recovery = start_recovery(self._recovery, now.now_s, left_m)
        if recovery is None:
            self._give_up(now)
        else:
            self._change(GoalEvent.STUCK)
            self._try(world, recovery, now)

    def _give_up(self, now: StepInput) -> None:
        began_s = now.now_s if self._recovery is None else self._recovery.began_s
        why = "; ".join(filter(None, (self._why_stuck, self._noise)))
        self.end(End.BLOCKED, f"blocked for {now.now_s - began_s:.0f} s: {why}")

    def _try(self, world: WorldModel, recovery: Recovery, now: StepInput) -> None:
        self._recovery, self._backed_from = recovery, now.pose
        self.reason = f"{self._why_stuck}: {SENTENCES[recovery.action]}"
        if recovery.action is Action.OTHER_WAY and self.trip is not None:
            ahead = self.trip.left.points_m
            until_s = recovery.action_began_s + CLOSED_S
            world.close(ahead[min(len(ahead) - 1, 8)], until_s)

    def _recover(
        self, world: WorldModel, recovery: Recovery, now: StepInput, near: Surroundings
    ) -> Twist2D | None:
        waits = recovery.action in (Action.WAIT, Action.ASK)
        is_done = is_over(recovery, now.now_s, self._params.slower)
        if recovery.action is Action.BACK_OUT and not is_done:
            backing = back_out(self._params, world.trail, self._backed_from, now, near)
            if backing is not None:
                return backing
            is_done = True
        is_time = is_done if not waits else now.now_s - self._planned_s >= AGAIN_S
        if is_time and self._try_again(world, now, near, with_closed=not waits):
            return None
        if is_done:
            following = after(recovery, now.now_s)
            if following is None:
                self._give_up(now)
            else:
                self._try(world, following, now)
        return None

    def _try_again(self, world: WorldModel, now: StepInput, near: Surroundings, *, with_closed: bool) -> bool:
        """Whether there is an end to recovering: a path that can be begun with, or none at all."""
        trip = self._find(world, now, with_closed=with_closed)
        if isinstance(trip, NoPath):
            if trip.only_for_now or now.status is PoseStatus.UNCERTAIN:
                return False
            self.end(End.UNREACHABLE, f"unreachable: {trip.reason}")
            return True
        if not with_closed:
            if not can_begin(self._params, world, trip, now, near):
                return False
            world.open_all()  # there was no other way: what was taken for closed is to be driven through
        self._set_out(trip, now)
        return True
