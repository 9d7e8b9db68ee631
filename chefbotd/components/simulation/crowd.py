"""People who walk around, and things in the way: discs on the floor that are on no map."""

import math
from collections.abc import Sequence

import numpy as np

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.parameters.simulation import PersonParameters, ThingParameters
from chefbotd.core.geometry import Pose2D

PACE_SPREAD = 0.1
"""The standard deviation of people's speeds and pauses, as a share of the configured value (assumed)."""


class Person:
    """Walks along a path, back and forth or in circles; may wait for the robot."""

    def __init__(self, parameters: PersonParameters, chance: np.random.Generator) -> None:
        self._parameters, self._chance = parameters, chance
        path = parameters.path_m + ((parameters.path_m[0],) if parameters.closed_path else ())
        self._points = np.array(path, np.float64).reshape(-1, 2)
        lengths = np.hypot(*np.diff(self._points, axis=0).T)
        self._at_m = np.concatenate(([0.0], np.cumsum(lengths)))
        self._speed_m_s = parameters.speed_m_s * self._spread()
        self._walked_m, self._direction = min(parameters.start_m, self._at_m[-1]), 1
        self._pause_s = 0.0

    def _spread(self) -> float:
        return float(np.clip(1 + PACE_SPREAD * self._chance.standard_normal(), 0.5, 1.5))

    @property
    def disc(self) -> tuple[float, float, float]:
        """The person's present position and radius."""
        return (*self._place(self._walked_m), self._parameters.radius_m)

    def step(self, dt_s: float, robot: Pose2D, robot_radius_m: float) -> None:
        """Walk on for ``dt_s``, unless it pauses or waits for the robot to pass."""
        if self._pause_s > 0:
            self._pause_s -= dt_s
            return
        length_m = float(self._at_m[-1])
        if length_m == 0:
            return
        wanted_m = self._walked_m + self._direction * self._speed_m_s * dt_s
        if self._parameters.stops_for_robot and self._is_met(wanted_m, robot, robot_radius_m):
            return
        if 0 <= wanted_m <= length_m:
            self._walked_m = wanted_m
            return
        self._turn_back(length_m)

    def _turn_back(self, length_m: float) -> None:
        """At the end of the path: pause, then go on."""
        if self._parameters.closed_path:
            self._walked_m = 0.0
        else:
            self._walked_m = length_m if self._direction > 0 else 0.0
            self._direction = -self._direction
        self._pause_s = self._parameters.pause_s * self._spread()
        self._speed_m_s = self._parameters.speed_m_s * self._spread()

    def _is_met(self, wanted_m: float, robot: Pose2D, robot_radius_m: float) -> bool:
        """Whether the next step would bring this person too close to the robot."""
        kept_m = self._parameters.radius_m + robot_radius_m + self._parameters.min_distance_m
        now, then = self._place(self._walked_m), self._place(wanted_m)
        robot_place = (robot.x_m, robot.y_m)
        return math.dist(then, robot_place) < kept_m and math.dist(then, robot_place) < math.dist(
            now, robot_place
        )

    def _place(self, walked_m: float) -> tuple[float, float]:
        x = np.interp(walked_m, self._at_m, self._points[:, 0])
        y = np.interp(walked_m, self._at_m, self._points[:, 1])
        return float(x), float(y)


class Crowd:
    """All people and things; ``discs`` (D x 3: x, y, radius) are their present places."""

    def __init__(
        self, people: Sequence[PersonParameters], things: Sequence[ThingParameters], seed: int
    ) -> None:
        self._people = [
            Person(parameters, np.random.default_rng((seed, number)))
            for number, parameters in enumerate(people)
        ]
        self._things = {
            f"thing {number}": (thing.x_m, thing.y_m, thing.radius_m) for number, thing in enumerate(things)
        }
        self._discs = self._gathered()

    @property
    def discs(self) -> Vector:
        """Work out the present place of every person and thing."""
        return self._discs

    def put(self, name: str, x_m: float, y_m: float, radius_m: float = 0.25) -> None:
        """Put a thing at this place, or move the one that has this name. The robot can touch it at its next step."""
        self._things[name] = (x_m, y_m, radius_m)
        self._discs = self._gathered()

    def take_away(self, name: str) -> None:
        """Remove a thing. Raises ``KeyError`` if no thing has this name."""
        del self._things[name]
        self._discs = self._gathered()

    def step(self, dt_s: float, robot: Pose2D, robot_radius_m: float) -> None:
        """Let everybody walk on for ``dt_s``."""
        if self._people:
            for person in self._people:
                person.step(dt_s, robot, robot_radius_m)
            self._discs = self._gathered()

    def _gathered(self) -> Vector:
        discs = [*[person.disc for person in self._people], *self._things.values()]
        return np.array(discs, np.float64).reshape(-1, 3)
