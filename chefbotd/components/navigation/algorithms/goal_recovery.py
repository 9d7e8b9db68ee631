"""Recovers a robot that is stuck on the way to one goal: tries one thing after the other, until there is a path."""

from chefbotd.components.navigation.algorithms.driving import can_begin
from chefbotd.components.navigation.algorithms.goal_search import GoalSearch
from chefbotd.components.navigation.algorithms.interface import PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.path import NoPath
from chefbotd.components.navigation.algorithms.recovery import (
    AGAIN_S,
    CLOSED_S,
    SENTENCES,
    Action,
    Recovery,
    after,
    back_out,
    is_over,
    start_recovery,
)
from chefbotd.components.navigation.algorithms.states import End
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.components.navigation.algorithms.trips import Trip
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, join_sentences


class RecoveryStep(Record, frozen=True):
    """The twist to recover with (None: stand), the path with which it is over, or how and why the goal ends.

    Else ``reason`` says what is tried from now on ("": the same as before).
    """

    twist: Twist2D | None = None
    trip: Trip | None = None
    end: End | None = None
    reason: str = ""


class GoalRecovery:
    """What was tried on the way to the goal of ``search``, and why."""

    def __init__(self, search: GoalSearch) -> None:
        self._search = search
        self._recovery: Recovery | None = None
        self._why_stuck = ""
        self._backed_from = Pose2D()

    @property
    def has_begun(self) -> bool:
        """Whether anything was tried."""
        return self._recovery is not None

    def forget_tries(self) -> None:
        """Begin with the first thing to try the next time."""
        self._recovery = None

    def forget(self) -> None:
        """The robot goes to another place: also why it was stuck does not count."""
        self._recovery, self._why_stuck = None, ""

    def start(
        self, world: WorldModel, inputs: StepInput, why: str, left_m: float, trip: Trip | None, noise: str
    ) -> RecoveryStep:
        """The robot is stuck, with so much of its way left: try the first or the next thing, or give up."""
        self._why_stuck = why
        recovery = start_recovery(self._recovery, inputs.now_s, left_m)
        if recovery is None:
            return self._give_up(inputs, noise)
        return self._try(world, recovery, inputs, trip)

    def step(
        self, world: WorldModel, inputs: StepInput, surroundings: Surroundings, trip: Trip | None, noise: str
    ) -> RecoveryStep:
        """One step of what is tried."""
        recovery, params = self._recovery, self._search.params
        if recovery is None:
            return RecoveryStep()
        waits = recovery.action in (Action.WAIT, Action.ASK)
        is_done = is_over(recovery, inputs.now_s, params.slower)
        if recovery.action is Action.BACK_OUT and not is_done:
            backing = back_out(params, world.trail, self._backed_from, inputs, surroundings)
            if backing is not None:
                return RecoveryStep(backing)
            is_done = True
        is_time = is_done if not waits else inputs.now_s - self._search.planned_s >= AGAIN_S
        ending = self._find_again(world, inputs, surroundings, with_closed=not waits) if is_time else None
        if ending is not None:
            return ending
        if not is_done:
            return RecoveryStep()
        following = after(recovery, inputs.now_s)
        return (
            self._give_up(inputs, noise) if following is None else self._try(world, following, inputs, trip)
        )

    def _give_up(self, inputs: StepInput, noise: str) -> RecoveryStep:
        began_s = inputs.now_s if self._recovery is None else self._recovery.began_s
        why = join_sentences((self._why_stuck, noise))
        return RecoveryStep(
            end=End.BLOCKED,
            reason=Sentence(
                "navigation.blocked_for",
                "blocked for {seconds:.0f} s: {why}",
                seconds=inputs.now_s - began_s,
                why=why,
            ),
        )

    def _try(
        self, world: WorldModel, recovery: Recovery, inputs: StepInput, trip: Trip | None
    ) -> RecoveryStep:
        self._recovery, self._backed_from = recovery, inputs.pose
        if recovery.action is Action.OTHER_WAY and trip is not None:
            ahead = trip.left.points_m
            until_s = recovery.action_began_s + CLOSED_S
            world.close(ahead[min(len(ahead) - 1, 8)], until_s)
        return RecoveryStep(
            reason=Sentence(
                "navigation.tries", "{why}: {action}", why=self._why_stuck, action=SENTENCES[recovery.action]
            )
        )

    def _find_again(
        self, world: WorldModel, inputs: StepInput, surroundings: Surroundings, *, with_closed: bool
    ) -> RecoveryStep | None:
        """The end of recovering, if there is one: a path that can be begun with, or none at all."""
        trip = self._search.find(world, inputs, with_closed=with_closed)
        if isinstance(trip, NoPath):
            if trip.only_for_now or inputs.status is PoseStatus.UNCERTAIN:
                return None
            return RecoveryStep(
                end=End.UNREACHABLE,
                reason=Sentence("navigation.unreachable", "unreachable: {why}", why=trip.reason),
            )
        if not with_closed:
            if not can_begin(self._search.params, world, trip, inputs, surroundings):
                return None
            world.open_all()  # there was no other way: what was taken for closed is to be driven through
        return RecoveryStep(trip=trip)
