"""Applies the obstacle guards of range sensors and lidars to a motion."""

import math
from collections.abc import Callable, Mapping
from operator import sub
from typing import Any, Protocol

from chefbotd.bus import Bus, OnError
from chefbotd.core.events import RangeMeasured
from chefbotd.core.geometry import STANDING, Motion, Pose2D
from chefbotd.core.record import MutableState, StatefulValue
from chefbotd.motion.kinematics import Kinematics
from chefbotd.safety import guard
from chefbotd.safety.guard import GuardParameters, WheelAngles

OBSTACLE = "obstacle:"


class Scans(Protocol):
    """A guard by scans, which the obstacle guard asks."""

    def limit(self, motion: Motion, now_s: float, late_s: float = 0.0) -> tuple[Motion, str | None]:
        """The motion that may be driven, and what it was limited for (None: it is ``wanted``).

        ``late_s`` passes until the board obeys, in addition to the guard's ``reaction_s``.
        """
        ...

    def state(self) -> Any:
        """Its state."""
        ...

    def restore(self, state: Any) -> None:
        """Restore this state."""
        ...


class WheelsAtReading(MutableState, array_like=True):
    """The wheels' angles at the last reading of the encoders, when it came, and which wheels were excluded."""

    wheels_rad: WheelAngles = ()
    read_s: float = -math.inf
    excluded: tuple[int, ...] = ()


class ObstacleGuard(StatefulValue[guard.Beams]):
    """Keeps the readings of the range sensors; the guard by scans is a part of its own.

    ``mounts`` are the range sensors that guard: ``base_from_sensor`` by name.

    ``scans`` makes the guard by lidars. It gets ``on_error``, which takes the errors of handlers. ``kinematics`` (None:
    the robot counts as standing) says how far the wheels have moved the robot since a reading; who reads the encoders
    writes into ``wheels``.
    """

    def __init__(
        self,
        bus: Bus,
        parameters: GuardParameters,
        mounts: Mapping[str, Pose2D],
        scans: Callable[[OnError], Scans] | None,
        on_error: OnError,
        kinematics: Kinematics | None = None,
    ) -> None:
        self._parameters, self.memory = parameters, guard.from_mounts(mounts)
        self._kinematics = kinematics
        self.wheels = WheelsAtReading()
        self._weights: tuple[tuple[float, float], ...] = ()
        self._weighed_without: tuple[int, ...] | None = None
        self.scans = None if scans is None else scans(on_error)
        bus.add_handler(self._on_range, RangeMeasured, on_error=on_error)

    def limit(self, asked_motion: Motion, now_s: float, late_s: float = 0.0) -> tuple[Motion, str | None]:
        """The motion that may be driven, and what it was limited for (None: it is ``wanted``).

        ``late_s`` passes until the board obeys, in addition to ``reaction_s``.
        """
        motion, sensor = guard.limit(
            self._parameters, self.memory, asked_motion, now_s, late_s=late_s, moved=self._moved
        )
        limited_by = None if sensor is None else OBSTACLE + sensor
        if self.scans is None:
            return motion, limited_by
        free, seen = self.scans.limit(motion, now_s, late_s)
        if seen is None:
            return motion, limited_by
        return self._agreed(self.scans, free, now_s, late_s), seen

    def _agreed(self, scans: Scans, motion: Motion, now_s: float, late_s: float) -> Motion:
        """Limit a motion that was limited already: a part of it may bring a beam closer than the whole would."""
        again, sensor = guard.limit(
            self._parameters, self.memory, motion, now_s, late_s=late_s, moved=self._moved
        )
        if sensor is None:
            return motion
        return again if scans.limit(again, now_s, late_s)[1] is None else STANDING

    def _on_range(self, event: RangeMeasured) -> None:
        self.memory = guard.update(
            self._parameters, self.memory, event, self.wheels.wheels_rad, self.wheels.read_s, self._moved
        )

    def _moved(self, wheels_rad: WheelAngles) -> tuple[float, float]:
        """How far the robot has come since its wheels stood so: metres ahead, and radians to the left."""
        excluded = self.wheels.excluded
        if excluded != self._weighed_without:
            self._weighed_without = excluded
            self._weights = () if self._kinematics is None else self._kinematics.travel_weights(excluded)
        ahead_m = turned_rad = 0.0
        rolled_rad = map(sub, self.wheels.wheels_rad, wheels_rad)
        for rad, (ahead_m_per_rad, turned_per_rad) in zip(rolled_rad, self._weights, strict=False):
            ahead_m += rad * ahead_m_per_rad
            turned_rad += rad * turned_per_rad
        return ahead_m, turned_rad
