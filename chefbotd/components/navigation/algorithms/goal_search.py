"""Searches the path to one goal: by what is known now or, where a thing of the map alone is in the way, to look at it.

Poses are ``map_from_base``.
"""

import math

from chefbotd.components.navigation.algorithms.interface import NavigationParameters, PoseStatus, StepInput
from chefbotd.components.navigation.algorithms.looking import (
    LOOKS_S,
    MOST_LOOKS,
    Look,
    in_the_way,
    look_out,
    place_of,
)
from chefbotd.components.navigation.algorithms.path import Goal, NoPath, Planner
from chefbotd.components.navigation.algorithms.trips import Trip, find
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence


class GoalSearch:
    """``goal`` is what is searched for, ``planned_s`` when it was last."""

    def __init__(self, params: NavigationParameters, planner: Planner, goal: Goal) -> None:
        self.params, self._planner, self.goal = params, planner, goal
        self.planned_s = -math.inf
        self._look = Look()

    def search_other(self, goal: Goal, *, is_renewed: bool) -> None:
        """Search for another goal from now on; what it looked at counts further if that ``is_renewed``."""
        self.goal = goal
        if not is_renewed:
            self._look = Look()

    @property
    def sentence(self) -> str:
        """What the robot does on the path that was found."""
        if self.is_looking:
            return self._look.reason
        return Sentence(
            "navigation.drives_to", "drives to ({x_m:.2f}, {y_m:.2f})", x_m=self.goal.x_m, y_m=self.goal.y_m
        )

    @property
    def standing_sentences(self) -> list[str]:
        """What it saw where it went to look."""
        return [
            Sentence(
                "navigation.still_stands", "it went to look: something still stands at {place}", place=place
            )
            for place in self._look.standing
        ]

    def find(self, world: WorldModel, inputs: StepInput, *, with_closed: bool = True) -> Trip | NoPath:
        """A path by what is known now."""
        self.planned_s = inputs.now_s
        pose = world.frame.pose_to_grid(inputs.pose)
        costs = world.costs_to_plan(inputs.now_s, pose, with_closed=with_closed)
        return find(self._planner, self.params.outline, costs, world.ground, inputs.pose, self.goal)

    def find_or_look(self, world: WorldModel, inputs: StepInput) -> Trip | NoPath:
        """The same or, where the map itself allows none, one to where the robot sees what is in the way."""
        trip = self.find(world, inputs)
        if isinstance(trip, NoPath) and not trip.only_for_now and world.open_gone():
            trip = self.find(world, inputs)
        if isinstance(trip, Trip) or trip.only_for_now:
            return trip
        return self._find_look_out(world, inputs) or trip

    def _find_look_out(self, world: WorldModel, inputs: StepInput) -> Trip | None:
        """To where it can be seen whether a thing of the map, which alone is in the way, is still there."""
        look = self._look
        if inputs.status is not PoseStatus.LOCALIZED or len(look.looked_from) >= MOST_LOOKS:
            return None
        outline, planner = self.params.outline, self._planner
        thing = in_the_way(world, planner, outline, inputs, self.goal)
        trip = None if thing is None else look_out(world, planner, outline, inputs, thing, look)
        if thing is None or trip is None:
            return None
        self._look = replace(look, thing=thing, place=place_of(world, thing), since_s=None)
        return trip

    @property
    def is_looking(self) -> bool:
        """Whether the robot goes to look at something, and not to its goal."""
        return self._look.thing is not None

    def ends_look(self, world: WorldModel, inputs: StepInput, *, has_arrived: bool) -> bool:
        """Whether it has seen enough of what it looks at: then a path is to be planned by that."""
        look, pose = self._look, world.frame.pose_to_grid(inputs.pose)
        if look.thing is None:
            return False
        since_s = inputs.now_s if look.since_s is None else look.since_s
        is_over = world.is_there(look.thing) or (has_arrived and inputs.now_s - since_s >= LOOKS_S)
        if not is_over and not world.open_gone():
            self._look = replace(look, since_s=since_s) if has_arrived else look
            return False
        standing = (*look.standing, look.place) if world.is_there(look.thing) else look.standing
        self._look = Look(looked_from=(*look.looked_from, (pose.x_m, pose.y_m)), standing=standing)
        return True
