"""Goals, from being accepted to their end: looks, plans, follows, recovers, and says what it does.

Time is an argument, and poses are ``map_from_base``. Who calls it brings scans as they come, and asks for a step at
the rate of the control.
"""

import math

from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.navigation.arcs import Surroundings
from chefbotd.navigation.awareness import Awareness
from chefbotd.navigation.costmap import Costmap
from chefbotd.navigation.driving import can_begin, follow_trip, surroundings
from chefbotd.navigation.follower import Followed, Phase, slewed
from chefbotd.navigation.goal_queue import GoalQueue, added, cancelled, first_ended
from chefbotd.navigation.input_watch import Missing, watched
from chefbotd.navigation.making_way import MakingWay, make_way
from chefbotd.navigation.parameters import NavigationParameters
from chefbotd.navigation.planner import Goal, NoPath, Path, plan
from chefbotd.navigation.progress_check import Coming, InTheWay, checked
from chefbotd.navigation.recovery import SAID, Recovery, Rung, after, is_over, stuck
from chefbotd.navigation.replanning import Choice, choice, is_due
from chefbotd.navigation.reports import Ended, PoseStatus, Progress, Seen, Step, StepInput
from chefbotd.navigation.states import End, Event, State, next_state
from chefbotd.navigation.trail import Trail, back_out, extended
from chefbotd.navigation.travel import seconds
from chefbotd.navigation.trips import Trip, find
from chefbotd.navigation.zones import NO_ZONES, Zones


class NoMapError(RuntimeError):
    """There is no map to navigate on."""


class Navigator:
    """Holds what the pure steps take and return: what is known, the goals, and how far the first of them is."""

    def __init__(self, params: NavigationParameters) -> None:
        self._params = params
        self._known: Awareness | None = None
        self._costs: Costmap | None = None
        self._state = State.IDLE
        self._queue = GoalQueue()
        self._ended: tuple[Ended, ...] = ()
        self._last, self._stepped_s = STANDING, -math.inf
        self._trail: Trail = ()
        self._reason = ""
        self._forget_goal()

    def _forget_goal(self) -> None:
        """What belongs to the present goal only."""
        self._trip: Trip | None = None
        self._recovery: Recovery | None = None
        self._why = ""
        self._planned_s = -math.inf
        self._missing = Missing()
        self._coming = Coming(-math.inf, Pose2D())
        self._backed_from = Pose2D()
        self._making_way = MakingWay()
        if self._known is not None:
            self._known.open_all()

    @property
    def state(self) -> State:
        """What it does now."""
        return self._state

    @property
    def path(self) -> Path | None:
        """What it follows, from where it is."""
        return None if self._trip is None else self._trip.left

    @property
    def planned(self) -> Path | None:
        """The same from where it began: another object whenever it is another path."""
        return None if self._trip is None else self._trip.path

    @property
    def known(self) -> Awareness | None:
        """What is known of the surroundings; None without a map."""
        return self._known

    @property
    def costs(self) -> Costmap | None:
        """The costs that the last plan was made with."""
        return self._costs

    # What it is told

    def use_map(self, grid: OccupancyGrid, zones: Zones = NO_ZONES) -> None:
        """Navigate on this map from now on; what was seen before is forgotten, and a path planned anew."""
        self._known = Awareness(self._params, grid, zones)
        self._costs, self._trail = self._known.ground, ()
        self._trip, self._recovery = None, None
        if self._state in (State.DRIVING, State.RECOVERING):
            self._state = State.PLANNING

    def take_scan(self, seen: Seen) -> None:
        """A scan; without a map nothing is remembered of it."""
        if self._known is not None:
            self._known.take_scan(seen)

    def take_range(
        self, stamp_s: float, map_from_base: Pose2D, base_from_sensor: Pose2D, range_m: float, view_rad: float
    ) -> None:
        """An echo of an ultrasonic or infrared sensor with a field of view."""
        if self._known is not None:
            self._known.take_range(stamp_s, map_from_base, base_from_sensor, range_m, view_rad)

    def navigate_to(self, goals: tuple[Goal, ...], *, queue: bool = False) -> tuple[int, ...]:
        """Accept goals, to be reached one after the other; those before are cancelled unless ``queue``. Their numbers.

        Raises:
            NoMapError: no map was given.
        """
        if self._known is None:
            raise NoMapError("there is no map to navigate on: load or make one first")
        if not queue:
            self.cancel("a new goal took its place")
        self._queue, numbers = added(self._queue, goals)
        if self._state is State.IDLE and self._queue.goals:
            self._begin()
        return numbers

    def cancel(self, reason: str = "as asked") -> None:
        """End all goals."""
        told = f"cancelled: {reason}"
        self._queue, ended = cancelled(self._queue, told)
        self._ended += ended
        if ended:
            self._become_idle(told)

    def fail(self, reason: str) -> None:
        """End all goals for what makes driving impossible, such as an e-stop."""
        if self._queue.goals:
            self._end(End.FAULT, f"fault: {reason}")

    def pause(self) -> None:
        """Stand until ``resume``; without a goal nothing happens."""
        if self._state in (State.PLANNING, State.DRIVING, State.RECOVERING):
            self._change(Event.PAUSED)
            self._reason = "paused"

    def resume(self) -> None:
        """Go on, from wherever the robot is now."""
        if self._state is State.PAUSED:
            self._change(Event.RESUMED)
            self._forget_goal()

    # What it is asked

    def plan_to(self, start: Pose2D, goal: Goal, now_s: float) -> Path | NoPath:
        """What would be driven, with what is known now.

        Raises:
            NoMapError: no map was given.
        """
        if self._known is None:
            raise NoMapError("there is no map to plan on: load or make one first")
        here = self._known.frame.pose_to_grid(start)
        costs = self._known.costs(now_s, here, with_closed=False)
        return plan(self._params.planner, self._params.outline, costs, start, goal)

    def time_s(self, path: Path, start: Pose2D) -> float:
        """How long a path will take, if nothing gets in the way."""
        return seconds(self._params.follower, path, path.frame.pose_to_grid(start), self._costs)

    def step(self, now_s: float, pose: Pose2D, status: PoseStatus = PoseStatus.LOCALIZED) -> Step:
        """What to do now; ``pose`` is where the robot is, ``now_s`` is not before that of the last step."""
        dt_s = min(max(now_s - self._stepped_s, 0.0), 0.2)
        self._stepped_s = now_s
        twist = None
        if self._known is not None and self._queue.goals and self._state is not State.PAUSED:
            standing = slewed(self._params.follower, self._last, STANDING, dt_s)
            wanted = self._act(self._known, StepInput(now_s, dt_s, pose, status, self._last))
            twist = standing if wanted is None else wanted
        self._last = STANDING if twist is None else twist
        ended, self._ended = self._ended, ()
        return Step(twist if self._queue.goals else None, self._progress(pose), ended)

    def _progress(self, pose: Pose2D) -> Progress:
        number = self._queue.number
        if self._trip is None:
            return Progress(self._state, number, self._reason)
        left = self._trip.left
        return Progress(self._state, number, self._reason, left.length_m, self.time_s(left, pose))

    # From state to state

    def _change(self, event: Event) -> None:
        self._state = next_state(self._state, event)

    def _begin(self) -> None:
        self._change(Event.GOAL_ACCEPTED)
        self._forget_goal()
        self._reason = "plans"

    def _become_idle(self, reason: str) -> None:
        self._change(Event.GOAL_ENDED)
        self._forget_goal()
        self._reason = reason

    def _end(self, end: End, reason: str) -> None:
        """End the first goal, and go on with the next one."""
        self._queue, ended = first_ended(self._queue, end, reason)
        self._ended += ended
        self._become_idle(reason)
        if self._queue.goals:
            self._begin()

    def _act(self, known: Awareness, now: StepInput) -> Twist2D | None:
        """The twist of the present state; None is standing."""
        if not self._has_input(known, now):
            return None
        if self._state is State.PLANNING:
            self._plan(known, now)
            return None
        near = surroundings(self._params, known, now)
        if self._state is State.RECOVERING and self._recovery is not None:
            wanted = self._recover(known, self._recovery, now, near)
        else:
            wanted = self._drive(known, now, near)
        if not self._queue.goals:
            return None
        self._making_way, twist = make_way(self._params, self._making_way, now, near, wanted)
        return twist

    def _has_input(self, known: Awareness, now: StepInput) -> bool:
        """Whether pose and scans are there to plan and drive by."""
        found = watched(self._params, self._missing, now, known.scan_stamp_s)
        self._missing = found.missing
        if found.stands:
            self._reason = found.stands
        elif found.is_over and self._state is State.DRIVING:
            self._reason = self._drives()
        if found.end is not None:
            self._end(found.end, found.reason)
        return not found.stands

    # Planning

    def _find(self, known: Awareness, now: StepInput, *, with_closed: bool = True) -> Trip | NoPath:
        self._planned_s = now.now_s
        self._costs = known.costs(now.now_s, known.frame.pose_to_grid(now.pose), with_closed=with_closed)
        goal, params = self._queue.goals[0][1], self._params
        return find(params.planner, params.outline, self._costs, known.ground, now.pose, goal)

    def _plan(self, known: Awareness, now: StepInput) -> None:
        found = self._find(known, now)
        if isinstance(found, Trip):
            self._set_out(found, now)
        elif found.only_for_now:
            self._become_stuck(known, now, found.reason)
        else:
            self._end(End.UNREACHABLE, f"unreachable: {found.reason}")

    def _set_out(self, trip: Trip, now: StepInput) -> None:
        self._change(Event.PATH_FOUND)
        self._trip, self._coming = trip, Coming(now.now_s, now.pose)
        self._reason = self._drives()

    def _drives(self) -> str:
        goal = self._queue.goals[0][1]
        return f"drives to ({goal.x_m:.2f}, {goal.y_m:.2f})"

    def _replan(self, known: Awareness, trip: Trip, now: StepInput, near: Surroundings) -> None:
        """Take a better path, or one round what blocks the present one."""
        if not is_due(self._params, trip, self._planned_s, now.now_s):
            return
        found = self._find(known, now)
        chosen = choice(self._params, self._costs or known.ground, trip, found, now, near)
        if isinstance(found, Trip) and chosen is Choice.TAKE_NEW:
            self._set_out(found, now)
        elif isinstance(found, NoPath) and chosen is Choice.STUCK:
            self._become_stuck(known, now, found.reason)

    # Driving

    def _drive(self, known: Awareness, now: StepInput, near: Surroundings) -> Twist2D | None:
        if self._trip is not None:
            self._replan(known, self._trip, now, near)
        trip = self._trip
        if self._state is not State.DRIVING or trip is None:
            return None
        done = follow_trip(self._params, known, trip, now, near)
        self._trip = trip = Trip(trip.path, done.state, trip.is_interim)
        if done.state.phase is Phase.DONE:
            self._arrive(known, trip, now)
            return None
        self._trail = extended(self._trail, near.grid_from_base, done.twist)
        self._judge(known, done, now, near)
        return done.twist if self._state is State.DRIVING else None

    def _arrive(self, known: Awareness, trip: Trip, now: StepInput) -> None:
        if trip.is_interim:
            goal = self._queue.goals[0][1]
            taken = f"something stands at the goal ({goal.x_m:.2f}, {goal.y_m:.2f})"
            self._become_stuck(known, now, taken)
            return
        told = f"reached ({now.pose.x_m:.2f}, {now.pose.y_m:.2f})"
        if trip.path.is_substitute:
            told += ", the nearest free place within the tolerance"
        self._end(End.REACHED, told)

    def _judge(self, known: Awareness, done: Followed, now: StepInput, near: Surroundings) -> None:
        """Whether it has been blocked, or has not come on, for too long."""
        in_the_way = None
        if done.is_blocked:
            in_the_way = InTheWay(known.nearest_ahead(near), known.meets_walker(near.grid_from_base))
        found = checked(self._params, self._coming, now, in_the_way)
        self._coming = found.coming
        if found.waits or found.drives_again:
            self._reason = found.waits or self._drives()
        if found.stuck:
            self._become_stuck(known, now, found.stuck)

    # Recovering

    def _become_stuck(self, known: Awareness, now: StepInput, why: str) -> None:
        goal, self._why = self._queue.goals[0][1], why
        left_m = math.hypot(goal.x_m - now.pose.x_m, goal.y_m - now.pose.y_m)
        if self._trip is not None:
            left_m = self._trip.left.length_m
        found = stuck(self._params.recovery, self._recovery, now.now_s, left_m)
        if found is None:
            self._give_up(now)
        else:
            self._change(Event.STUCK)
            self._try(known, found, now)

    def _give_up(self, now: StepInput) -> None:
        began_s = now.now_s if self._recovery is None else self._recovery.began_s
        self._end(End.BLOCKED, f"blocked for {now.now_s - began_s:.0f} s: {self._why}")

    def _try(self, known: Awareness, recovery: Recovery, now: StepInput) -> None:
        self._recovery, self._backed_from = recovery, now.pose
        self._reason = f"{self._why}: {SAID[recovery.rung]}"
        if recovery.rung is Rung.OTHER_WAY and self._trip is not None:
            ahead = self._trip.left.points_m
            until_s = recovery.rung_began_s + self._params.recovery.closed_s
            known.close(ahead[min(len(ahead) - 1, 8)], until_s)

    def _recover(
        self, known: Awareness, recovery: Recovery, now: StepInput, near: Surroundings
    ) -> Twist2D | None:
        params = self._params.recovery
        waits = recovery.rung in (Rung.WAIT, Rung.ASK)
        is_done = is_over(params, recovery, now.now_s)
        if recovery.rung is Rung.BACK_OUT and not is_done:
            backing = back_out(self._params, self._trail, self._backed_from, now, near)
            if backing is not None:
                return backing
            is_done = True
        is_time = is_done if not waits else now.now_s - self._planned_s >= params.again_s
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
            if not found.only_for_now:
                self._end(End.UNREACHABLE, f"unreachable: {found.reason}")
            return not found.only_for_now
        if not with_closed and not can_begin(self._params, known, found, now, near):
            return False
        self._set_out(found, now)
        return True
