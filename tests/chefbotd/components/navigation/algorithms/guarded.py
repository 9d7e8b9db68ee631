"""A simulated robot driven by the navigator through the obstacle guards of the gate."""

import math
from dataclasses import dataclass

import numpy as np

from chefbotd.components.navigation.algorithms.grid import place_points
from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.perception.surface_points import smooth_points
from chefbotd.safety import guard, scan_guard
from chefbotd.safety.guard import GuardParameters
from chefbotd.safety.outline import Disc, Outline
from chefbotd.safety.scan_guard import View
from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, cast
from tests.chefbotd.components.navigation.algorithms.drives import (
    BEARINGS,
    NOISE_M,
    RADIUS_M,
    SCAN_EVERY,
    Drive,
)

GUARD = GuardParameters()
NOSE = Pose2D(0.15, 0.0, 0.0)
CONE_RAD = np.linspace(-0.13, 0.13, 7)
TURN_S = 0.1
DIRECTIONS = np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1)
ROBOT = Disc(RADIUS_M)


@dataclass
class Guarded(Drive):
    """With an ultrasonic sensor at its nose (``has_sonar``), which reads ``short_m`` too little, and a lidar."""

    shape: Outline = ROBOT
    has_sonar: bool = True
    short_m: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.limited_by: set[str] = set()
        self._beams, self._blocked = guard.from_mounts({"front": NOSE}), STANDING
        self._turns: list[tuple[float, Floats]] = []  # the last two, in the world's frame

    def allowed(self, wanted: Twist2D) -> Twist2D:
        """As the daemon's obstacle guard does it: echoes of this moment, and the lidar's last two turns."""
        motion = wanted
        if self.has_sonar:
            measured = RangeMeasured(
                self.now_s, self.now_s, "front", RangeStatus.OK, self._echo_m(), 0.02, 4.0, 0.26
            )
            self._beams = guard.update(GUARD, self._beams, measured)
            motion, sensor = guard.limit(GUARD, self._beams, wanted, self.now_s)
            self.limited_by |= {sensor} - {None}
        view = self._view()
        allowed, seen = scan_guard.limit(GUARD, self.shape, (view,), motion, self.now_s, self._blocked)
        self._blocked = scan_guard.blocked_after(self._blocked, motion, allowed)
        self.limited_by |= {seen} - {None}
        return allowed

    def _echo_m(self) -> float:
        sensor = self.pose.compose(NOSE)
        return float(self._ranges(sensor, CONE_RAD).min()) - self.short_m

    def _view(self) -> View:
        if self.ticks % SCAN_EVERY == 0 or not self._turns:
            ranges = self._ranges(self.pose, BEARINGS) + self.chance.normal(0, NOISE_M, len(BEARINGS))
            turn = smooth_points(DIRECTIONS * ranges[:, None], np.zeros(2))
            self._turns = [*self._turns[-1:], (self.now_s, place_points(self.pose, turn))]
        points = place_points(self.pose.inverse(), np.vstack([turn for _, turn in self._turns]))
        stamp_s = self._turns[-1][0]
        return View("lidar", points, stamp_s, stamp_s, TURN_S)

    def _ranges(self, pose: Pose2D, bearings: Floats) -> Floats:
        people = np.array([(*p.at(p.along_m), p.radius_m) for p in self.people]).reshape(-1, 3)
        found: Floats = cast(self.walls, np.array([pose.x_m, pose.y_m, pose.heading_rad]), people, bearings)
        return found


def off(drive: Drive, x_m: float, y_m: float, heading_rad: float) -> tuple[float, float]:
    """How far the robot truly is from a pose: metres, degrees."""
    turned = math.remainder(drive.pose.heading_rad - heading_rad, math.tau)
    return math.dist((drive.pose.x_m, drive.pose.y_m), (x_m, y_m)), abs(math.degrees(turned))
