"""Executes one goal from its acceptance to its end: plans, drives, and recovers.

Poses are ``map_from_base``.
"""

import math

from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.driving import can_begin, follow_trip
from chefbotd.navigation.input_watch import LOST_S, Missing, watched
from chefbotd.navigation.making_way import MakingWay, make_way
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.path import Goal, NoPath, Planner
from chefbotd.navigation.progress_check import InTheWay, LastProgress, checked
from chefbotd.navigation.recovery import AGAIN_S, CLOSED_S, SAID, Recovery, Rung, after, is_over, stuck
from chefbotd.navigation.replanning import REPLAN_S, Choice, Waiting, choice, is_due, waiting
from chefbotd.navigation.reports import PoseStatus, StepInput
from chefbotd.navigation.states import End, Event, State, next_state
from chefbotd.navigation.steering import Followed, Phase
from chefbotd.navigation.surroundings import Surroundings
from chefbotd.navigation.trail import back_out
from chefbotd.navigation.trips import Trip, find


class GoalExecution:
    """Holds what the pure steps take and return for one goal; ``reason`` says what is done, ``ended`` how it ended."""

    def __init__(
        self, params: NavigationParameters, planner: Planner, goal: Goal, state: State, reason: str
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
        self._making_way = MakingWay()
        self._is_blocked = False
        self._waiting: Waiting | None = None
        self._recovery: Recovery | None = None
        self._why_stuck = ""
        self._backed_from = Pose2D()

    def use(self, params: NavigationParameters, *, has_to_rest: bool) -> None:
        """Go on with these; with ``has_to_rest`` the robot is still on its way, and has not arrived yet."""
        self._params, self._has_to_rest = params, has_to_rest

    def pause(self, reason: str) -> None:
        """Stand; what follows is a new execution."""
        if self.state is not State.PAUSED:
            self._change(Event.PAUSED)
        self.reason = reason

    def end(self, end: End, reason: str) -> None:
        """The goal has ended so."""
        self._change(Event.GOAL_ENDED)
        self.ended = (end, reason)

    def forget_path(self) -> None:
        """Plan anew, since there is another map."""
        self.trip, self._recovery = None, None
        if self.state in (State.DRIVING, State.RECOVERING):
            self.state = State.PLANNING

    def prepare(self, known: Awareness, now: StepInput) -> bool:
        """Whether the robot can drive in this step: pose and scans are there, and it is not planned first."""
        if not self._has_input(known, now):
            return False
        if self.state is State.PLANNING:
            self._plan(known, now)
            return False
        return True

    def drive(self, known: Awareness, now: StepInput, near: Surroundings) -> Twist2D | None:
        """The twist to drive, or to recover, with; None is standing."""
        self._is_blocked = False
        if self.state is State.RECOVERING and self._recovery is not None:
            return self._recover(known, self._recovery, now, near)
        return self._drive(known, now, near)

    def make_way(self, now: StepInput, near: Surroundings, wanted: Twist2D | None) -> Twist2D | None:
        """What is wanted, or, while the robot stands, a way out of somebody's way."""
        self._making_way, twist = make_way(
            self._params, self._making_way, now, near, wanted, is_blocked=self._is_blocked
        )
        return twist

    def _change(self, event: Event) -> None:
        self.state = next_state(self.state, event)

    def _has_input(self, known: Awareness, now: StepInput) -> bool:
        """Whether pose and scans are there to plan and drive by."""
        found = watched(self._params, self._missing, now, known.scan_stamp_s)
        self._missing = found.missing
        if found.stands:
            self.reason = found.stands
        elif found.is_over and self.state is State.DRIVING:
            self.reason = self._drives()
        if found.end is not None:
            self.end(found.end, found.reason)
        return not found.stands

    # Planning

    def _find(self, known: Awareness, now: StepInput, *, with_closed: bool = True) -> Trip | NoPath:
        self._planned_s = now.now_s
        here = known.frame.pose_to_grid(now.pose)
        costs = known.costs_to_plan(now.now_s, here, with_closed=with_closed)
        params = self._params
        return find(self._planner, params.outline, costs, known.ground, now.pose, self._goal)

    def _plan(self, known: Awareness, now: StepInput) -> None:
        if self._unsure_since_s is not None and now.now_s - self._planned_s < REPLAN_S:
            return
        found = self._find(known, now)
        if isinstance(found, Trip):
            self._set_out(found, now)
        elif found.only_for_now:
            self._become_stuck(known, now, found.reason)
        elif now.status is PoseStatus.UNCERTAIN:
            self._doubt(found, now)
        else:
            self.end(End.UNREACHABLE, f"unreachable: {found.reason}")

    def _doubt(self, found: NoPath, now: StepInput) -> None:
        """From where the robot may not be at all there is no way: look again when the pose is sure."""
        if self._unsure_since_s is None:
            self._unsure_since_s = now.now_s
        self.reason = f"waits, because it is not sure of its pose: {found.reason}"
        if now.now_s - self._unsure_since_s >= LOST_S:
            told = f"for {LOST_S:.0f} s the pose of the robot was uncertain"
            self.end(End.LOST, f"lost: {told}: {found.reason}")

    def _set_out(self, trip: Trip, now: StepInput) -> None:
        self._change(Event.PATH_FOUND)
        self._unsure_since_s = None
        self.trip, self._last_progress = trip, LastProgress(now.now_s, now.pose)
        self.reason = self._drives()

    def _drives(self) -> str:
        return f"drives to ({self._goal.x_m:.2f}, {self._goal.y_m:.2f})"

    def _replan(self, known: Awareness, trip: Trip, now: StepInput, near: Surroundings) -> None:
        """Take a better path, or one round what blocks the present one."""
        if not is_due(self._params, trip, self._planned_s, now.now_s):
            return
        found = self._find(known, now)
        chosen = choice(self._params, known.planned_costs, trip, found, now, near)
        if isinstance(found, Trip) and chosen is Choice.TAKE_NEW:
            since_s = now.now_s if self._waiting is None else self._waiting.since_s
            self._wait(waiting(self._params, known, trip, found, since_s, now.now_s), now)
            if self._waiting is None:
                self._set_out(found, now)
            return
        self._wait(None, now)
        if isinstance(found, NoPath) and chosen is Choice.STUCK:
            self._become_stuck(known, now, found.reason)

    def _wait(self, told: Waiting | None, now: StepInput) -> None:
        """Wait for somebody on the path, or no longer: waiting is no lack of progress."""
        if told is not None:
            self.reason = told.reason
        elif self._waiting is not None:
            self.reason = self._drives()
        if told is not None or self._waiting is not None:
            self._last_progress = LastProgress(now.now_s, now.pose)
        self._waiting = told

    # Driving

    def _drive(self, known: Awareness, now: StepInput, near: Surroundings) -> Twist2D | None:
        if self.trip is not None:
            self._replan(known, self.trip, now, near)
        trip = self.trip
        if self.state is not State.DRIVING or trip is None:
            return None
        done = follow_trip(self._params, known, trip, now, near)
        self._is_blocked = done.is_blocked
        if done.state.phase is Phase.DONE and self._has_to_rest:
            return None
        self.trip = trip = Trip(trip.path, done.state, trip.is_interim)
        if done.state.phase is Phase.DONE:
            self._arrive(known, trip, now)
            return None
        known.remember_drive(near.grid_from_base, done.twist)
        self._judge(known, done, now, near)
        return done.twist if self.state is State.DRIVING else None

    def _arrive(self, known: Awareness, trip: Trip, now: StepInput) -> None:
        if trip.is_interim:
            taken = f"something stands at the goal ({self._goal.x_m:.2f}, {self._goal.y_m:.2f})"
            self._become_stuck(known, now, taken)
            return
        told = f"reached ({now.pose.x_m:.2f}, {now.pose.y_m:.2f})"
        if trip.path.is_substitute:
            told += ", the nearest free place within the tolerance"
        self.end(End.REACHED, told)

    def _judge(self, known: Awareness, done: Followed, now: StepInput, near: Surroundings) -> None:
        """Whether it has been blocked, or has not come on, for too long."""
        in_the_way = None
        if done.is_blocked:
            where = known.nearest_ahead(near, done.turns_rad)
            in_the_way = InTheWay(where, known.meets_walker(near.grid_from_base))
        found = checked(self._params, self._last_progress, now, in_the_way)
        self._last_progress = found.progress
        if self._waiting is not None:
            return
        if found.waits or found.drives_again:
            self.reason = found.waits or self._drives()
        if found.stuck:
            beside = "" if done.is_blocked else known.beside(near)
            self._become_stuck(known, now, found.stuck + beside)

    # Recovering

    def _become_stuck(self, known: Awareness, now: StepInput, why: str) -> None:
        self._why_stuck = why
        left_m = math.hypot(self._goal.x_m - now.pose.x_m, self._goal.y_m - now.pose.y_m)
        if self.trip is not None:
            left_m = self.trip.left.length_m
        found = stuck(self._recovery, now.now_s, left_m)
        if found is None:
            self._give_up(now)
        else:
            self._change(Event.STUCK)
            self._try(known, found, now)

    def _give_up(self, now: StepInput) -> None:
        began_s = now.now_s if self._recovery is None else self._recovery.began_s
        self.end(End.BLOCKED, f"blocked for {now.now_s - began_s:.0f} s: {self._why_stuck}")

    def _try(self, known: Awareness, recovery: Recovery, now: StepInput) -> None:
        self._recovery, self._backed_from = recovery, now.pose
        self.reason = f"{self._why_stuck}: {SAID[recovery.rung]}"
        if recovery.rung is Rung.OTHER_WAY and self.trip is not None:
            ahead = self.trip.left.points_m
            until_s = recovery.rung_began_s + CLOSED_S
            known.close(ahead[min(len(ahead) - 1, 8)], until_s)

    def _recover(
        self, known: Awareness, recovery: Recovery, now: StepInput, near: Surroundings
    ) -> Twist2D | None:
        waits = recovery.rung in (Rung.WAIT, Rung.ASK)
        is_done = is_over(recovery, now.now_s, self._params.slower)
        if recovery.rung is Rung.BACK_OUT and not is_done:
            backing = back_out(self._params, known.trail, self._backed_from, now, near)
            if backing is not None:
                return backing
            is_done = True
        is_time = is_done if not waits else now.now_s - self._planned_s >= AGAIN_S
        if is_time and self._try_again(known, now, near, with_closed=not waits):
            return None
        if is_done:
            following = after(recovery, now.now_s)
            if following is None:
                self._give_up(now)
            else:
                self._try(known, following, now)
        return None

    def _try_again(self, known: Awareness, now: StepInput, near: Surroundings, *, with_closed: bool) -> bool:
        """Whether there is an end to recovering: a path that can be begun with, or none at all."""
        found = self._find(known, now, with_closed=with_closed)
        if isinstance(found, NoPath):
            if found.only_for_now or now.status is PoseStatus.UNCERTAIN:
                return False
            self.end(End.UNREACHABLE, f"unreachable: {found.reason}")
            return True
        if not with_closed and not can_begin(self._params, known, found, now, near):
            return False
        self._set_out(found, now)
        return True
