"""The whole of navigation as one step: takes maps, scans and goals, and returns the motion to drive.

Time is an argument, and poses are ``map_from_base``. Who calls it brings scans as they come, and asks for a step at
the rate of the control.
"""

import math
from collections.abc import Collection
from typing import Final

from chefbotd.components.navigation.algorithms.beside_people import slowed_beside_people
from chefbotd.components.navigation.algorithms.brake_for_people import brake_for_people
from chefbotd.components.navigation.algorithms.costmap import Costmap
from chefbotd.components.navigation.algorithms.crawl import CYCLE_S, Crawl, slow_for_silence, watch_silence
from chefbotd.components.navigation.algorithms.driving import POSE_SILENT_S, find_surroundings
from chefbotd.components.navigation.algorithms.goal_execution import GoalExecution
from chefbotd.components.navigation.algorithms.grid import Flags
from chefbotd.components.navigation.algorithms.interface import (
    Ended,
    NavigationParameters,
    PoseStatus,
    Progress,
    Seen,
    Step,
    StepInput,
)
from chefbotd.components.navigation.algorithms.noise import noise_sentence
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Path, Planner
from chefbotd.components.navigation.algorithms.planner import plan
from chefbotd.components.navigation.algorithms.states import (
    End,
    GoalEvent,
    GoalState,
    cancelled,
    cancelled_before,
    failed,
    next_state,
)
from chefbotd.components.navigation.algorithms.steering import limit_change
from chefbotd.components.navigation.algorithms.trips import Trip, duration_s, plan_now
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.zones.zone_file import NO_ZONES, Zones
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence, join_sentences

REPLACED: Final = Sentence("navigation.replaced", "a new goal replaced it")
AS_ASKED: Final = Sentence("navigation.as_asked", "as asked")
PAUSED: Final = Sentence("navigation.paused", "paused")

SILENT_BEFORE_S: Final = 1.5
"""For so long after the board was silent the robot, which stands where it did not choose to, makes way at any speed."""


class NoMapError(RuntimeError):
    """There is no map to navigate on."""


class GoalQueue(Record, frozen=True):
    """Goals with their numbers, the present one first, and how many were ever accepted."""

    goals: tuple[tuple[int, Goal], ...] = ()
    count: int = 0

    @property
    def number(self) -> int | None:
        """The present goal's."""
        return self.goals[0][0] if self.goals else None


def add_goals(queue: GoalQueue, goals: tuple[Goal, ...]) -> tuple[GoalQueue, tuple[int, ...]]:
    """The queue with goals behind those that are there, and their numbers."""
    numbers = tuple(range(queue.count + 1, queue.count + len(goals) + 1))
    behind = tuple(zip(numbers, goals, strict=True))
    return GoalQueue((*queue.goals, *behind), queue.count + len(goals)), numbers


def keep_goals(
    queue: GoalQueue, numbers: Collection[int], reason: str
) -> tuple[GoalQueue, tuple[Ended, ...]]:
    """The queue with no goals but these, and the ends of the others, which are cancelled."""
    ended = tuple(Ended(number, End.CANCELLED, reason) for number, _ in queue.goals if number not in numbers)
    left = tuple((number, goal) for number, goal in queue.goals if number in numbers)
    return replace(queue, goals=left), ended


def first_ended(queue: GoalQueue, end: End, reason: str) -> tuple[GoalQueue, tuple[Ended, ...]]:
    """The queue without its first goal; what was to follow one that was not reached makes no sense any more."""
    (number, _), *following = queue.goals
    first, left = Ended(number, end, reason), replace(queue, goals=tuple(following))
    if end is End.REACHED:
        return left, (first,)
    left, others = keep_goals(left, (), cancelled_before(number, end))
    return left, (first, *others)


class Navigator:
    """Holds the world model (None without a map), the goals, and the execution of the first; ``planner`` finds paths."""

    def __init__(self, params: NavigationParameters, planner: Planner = plan) -> None:
        self._params, self._planner = params, planner
        self.world: WorldModel | None = None
        self._execution: GoalExecution | None = None
        self._queue = GoalQueue()
        self._ended: tuple[Ended, ...] = ()
        self._last, self._stepped_s, self._silent_s = STANDING, -math.inf, -math.inf
        self._crawl, self._slow_params = Crawl(), slow_for_silence(params)
        self._idle_reason, self._status = "", PoseStatus.LOCALIZED

    @property
    def state(self) -> GoalState:
        """What it does now."""
        return GoalState.IDLE if self._execution is None else self._execution.state

    @property
    def crawls(self) -> bool:
        """Whether the board is silent in every cycle, so that the robot only crawls."""
        return self._crawl.is_on

    @property
    def is_unsure_at_goal(self) -> bool:
        """Whether the robot has come to its goal by a pose that is uncertain, and waits."""
        return self._execution is not None and self._execution.is_unsure_at_goal

    @property
    def _trip(self) -> Trip | None:
        return None if self._execution is None else self._execution.trip

    @property
    def path(self) -> Path | None:
        """What it follows, from where it is."""
        return None if self._trip is None else self._trip.left

    @property
    def planned(self) -> Path | None:
        """The same from where it began: another object whenever it is another path."""
        return None if self._trip is None else self._trip.path

    @property
    def costs(self) -> Costmap | None:
        """The costs that the last plan was made with."""
        return None if self.world is None else self.world.planned_costs

    # Inputs

    def use_map(self, grid: OccupancyGrid, zones: Zones = NO_ZONES, closed: Flags | None = None) -> None:
        """Navigate on this map from now on; what was seen before is forgotten, and a path is planned again."""
        self.world = WorldModel(self._params, grid, zones, closed)
        if self._execution is not None:
            self._execution.forget_path()

    def redraw_map(self, grid: OccupancyGrid, zones: Zones, closed: Flags | None) -> None:
        """The same map was edited, or its zones were changed: a path is planned again, with what was seen."""
        if self.world is None:
            self.use_map(grid, zones, closed)
            return
        self.world.redraw(grid, zones, closed)
        if self._execution is not None:
            self._execution.forget_path()

    def free_map(self) -> None:
        """Forget the map: another one is being made ready, and both may be too much. The robot stands meanwhile."""
        self.world = None
        if self._execution is not None:
            self._execution.forget_path()

    def take_scan(self, seen: Seen) -> None:
        """A scan; without a map nothing is remembered of it. After a jump of the pose a path is planned again."""
        if self.world is None:
            return
        is_void = self.world.add_scan(seen, is_sure=self._status is PoseStatus.LOCALIZED)
        if is_void and self._execution is not None:
            self._execution.forget_path()

    def take_low_scan(self, seen: Seen) -> None:
        """What a depth camera sees; without a map nothing is remembered of it."""
        if self.world is not None:
            self.world.take_low_scan(seen)

    def take_range(
        self, stamp_s: float, map_from_base: Pose2D, base_from_sensor: Pose2D, range_m: float, view_rad: float
    ) -> None:
        """An echo of an ultrasonic or infrared sensor with a field of view."""
        if self.world is not None:
            self.world.add_range(stamp_s, map_from_base, base_from_sensor, range_m, view_rad)

    def navigate_to(self, goals: tuple[Goal, ...], *, queue: bool = False) -> tuple[int, ...]:
        """Accept goals, to be reached one after the other; those before are cancelled unless ``queue``. Their numbers.

        A goal that replaces another under way is planned while the robot drives on.

        Raises:
            NoMapError: no map was given.
        """
        if self.world is None:
            raise NoMapError("there is no map to navigate on: load or make one first")
        if queue or not goals or self._execution is None:
            if not queue:
                self.cancel(REPLACED)
            self._queue, numbers = add_goals(self._queue, goals)
            if self._execution is None:
                self._execute_next()
            return numbers
        self._queue, ended = keep_goals(self._queue, (), cancelled(REPLACED))
        self._ended += ended
        self._queue, numbers = add_goals(self._queue, goals)
        if not self._execution.retarget(goals[0]):
            self._open_all()
        return numbers

    def cancel(self, reason: str = AS_ASKED) -> None:
        """End all goals."""
        self.keep((), reason)

    def keep(self, numbers: Collection[int], reason: str = AS_ASKED) -> None:
        """Cancel all goals but these."""
        sentence, before = cancelled(reason), self._queue.number
        self._queue, ended = keep_goals(self._queue, numbers, sentence)
        self._ended += ended
        if self._execution is not None and self._queue.number != before:
            self._execution.end(End.CANCELLED, sentence)
            self._become_idle(sentence)
            self._execute_next()

    def fail(self, reason: str) -> None:
        """End all goals for what makes driving impossible, such as an e-stop."""
        if self._execution is not None:
            self._execution.end(End.FAULT, failed(reason))
            self._settle(self._execution)

    def pause(self, reason: str = PAUSED) -> None:
        """Stand until ``resume``; without a goal nothing happens."""
        if self._execution is not None:
            self._execution.pause(reason)

    def resume(self) -> None:
        """Go on, from wherever the robot is now."""
        if self._execution is not None and self.state is GoalState.PAUSED:
            self._execute(next_state(GoalState.PAUSED, GoalEvent.RESUMED), self._execution.reason)

    # Outputs

    def plan_path(self, start: Pose2D, goal: Goal, now_s: float) -> Path | NoPath:
        """What would be driven, with what is known now.

        Raises:
            NoMapError: no map was given.
        """
        if self.world is None:
            raise NoMapError("there is no map to plan on: load or make one first")
        pose = self.world.frame.pose_to_grid(start)
        costs = self.world.costs(now_s, pose, with_closed=False)
        return plan_now(self._planner, self._params.outline, costs, self.world.ground, start, goal)

    def time_s(self, path: Path, start: Pose2D) -> float:
        """How long a path will take, if nothing gets in the way."""
        return duration_s(self._params.follower, path, path.frame.pose_to_grid(start), self.costs)

    def step(
        self, now_s: float, pose: Pose2D, status: PoseStatus = PoseStatus.LOCALIZED, pose_age_s: float = 0.0
    ) -> Step:
        """What to do now; ``pose`` is where the robot is, ``now_s`` is not before that of the last step.

        ``pose_age_s`` is how long ago the pose was measured; since then the robot is expected to move on as it did.
        """
        dt_s = min(max(now_s - self._stepped_s, 0.0), 0.2)
        self._stepped_s, self._status = now_s, status
        read_s = now_s - pose_age_s
        if pose_age_s > POSE_SILENT_S:
            self._silent_s = now_s
        if self._params.silent_speed_m_s > 0:
            self._crawl = watch_silence(self._crawl, read_s, now_s, POSE_SILENT_S, self._last)
        if self._crawl.is_on and self.state in (GoalState.PLANNING, GoalState.DRIVING, GoalState.RECOVERING):
            return self._crawled(now_s, read_s, pose, status)
        if self._crawl.is_on and self._crawl.is_due(read_s, now_s):
            self._crawl = self._crawl.then(read_s, STANDING)
        twist = None
        execution = self._execution
        if execution is not None and execution.state is not GoalState.PAUSED:
            standing = limit_change(self._params.follower, self._last, STANDING, dt_s)
            inputs = StepInput(now_s, dt_s, pose, status, self._last, pose_age_s)
            chosen = None if self.world is None else self._act(self.world, execution, inputs)
            twist = standing if chosen is None else chosen
        self._last = STANDING if twist is None else twist
        ended, self._ended = self._ended, ()
        return Step(None if self._execution is None else twist, self._progress(pose), ended)

    def _crawled(self, now_s: float, read_s: float, pose: Pose2D, status: PoseStatus) -> Step:
        """The last command continues until there is another reading; the next one is decided by that."""
        crawl, execution = self._crawl, self._execution
        if self.world is not None and execution is not None and crawl.is_due(read_s, now_s):
            dt_s = min(read_s - crawl.decided_s, CYCLE_S)
            inputs = StepInput(now_s, dt_s, crawl.predicted(pose), status, crawl.asked[0])
            twist = self._act(self.world, execution, inputs)
            self._last = STANDING if twist is None else twist
            self._crawl = crawl.then(read_s, self._last)
        ended, self._ended = self._ended, ()
        return Step(None if self._execution is None else self._last, self._progress(pose), ended)

    def _progress(self, pose: Pose2D) -> Progress:
        number = self._queue.number
        reason = self._idle_reason if self._execution is None else self._execution.reason
        if self.world is not None and self._execution is not None:
            reason = join_sentences((reason, noise_sentence(self.world.noise_share)))
        if self._trip is None:
            return Progress(self.state, number, reason)
        left = self._trip.left
        return Progress(self.state, number, reason, left.length_m, self.time_s(left, pose))

    # From goal to goal

    def _act(self, world: WorldModel, execution: GoalExecution, inputs: StepInput) -> Twist2D | None:
        """The twist for the present goal; None is standing."""
        crawls = self._crawl.is_on
        execution.use(
            self._slow_params if crawls else self._params, has_to_rest=crawls and not self._crawl.rests
        )
        if not execution.prepare(world, inputs):
            self._settle(execution)
            return None
        surroundings = find_surroundings(self._slow_params if crawls else self._params, world, inputs)
        twist = execution.drive(world, inputs, surroundings)
        self._settle(execution)
        if self._execution is None or crawls:  # a board that obeys so late evades nobody
            return None if self._execution is None else twist
        twist = self._execution.evade(inputs, surroundings, twist)
        slowed = slowed_beside_people(self._params.outline, surroundings, twist)
        if inputs.now_s - self._silent_s < SILENT_BEFORE_S:
            return slowed
        return brake_for_people(
            self._params.outline, surroundings, inputs.last, slowed, twist, self._params.agility
        )

    def _settle(self, execution: GoalExecution) -> None:
        """Go on with the next goal if this one has ended."""
        if execution.ended is None:
            return
        end, reason = execution.ended
        self._queue, ended = first_ended(self._queue, end, reason)
        self._ended += ended
        self._become_idle(reason)
        self._execute_next()

    def _become_idle(self, reason: str) -> None:
        self._execution, self._idle_reason = None, reason
        self._open_all()

    def _execute_next(self) -> None:
        """Begin with the first goal, if there is one."""
        if self._queue.goals:
            self._execute(
                next_state(GoalState.IDLE, GoalEvent.GOAL_ACCEPTED), Sentence("navigation.plans", "plans")
            )

    def _execute(self, state: GoalState, reason: str) -> None:
        self._execution = GoalExecution(self._params, self._planner, self._queue.goals[0][1], state, reason)
        self._open_all()

    def _open_all(self) -> None:
        """What was taken for closed on the way to one goal may be open on the way to another."""
        if self.world is not None:
            self.world.open_all()
