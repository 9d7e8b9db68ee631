"""A robot in a room that does what a procedure says: wheels that scatter, and a lidar; independent of the simulator."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Measurements,
    Move,
    Procedure,
)
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel
from chefbotd.components.simulation.world import RayCaster
from chefbotd.core.events import WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import ORIGIN, Twist2D
from chefbotd.core.record import Record
from chefbotd.core.scan import LaserScan
from chefbotd.settings.loader import load
from tests.chefbotd.components.mapping.algorithms.slam.flat import furnished_flat

CONFIG = Path(__file__).parents[5] / "config" / "chefbot_lidar.toml"
STEP_S, TURN_S, BEAMS, NOISE_M = 0.05, 0.1, 450, 0.01
MIDDLE = (6.0, 5.9, 0.3)
"""In a room of the flat."""


class Truth(Record, frozen=True):
    """How the robot differs from its configuration; ``slip`` is a share of the scatter that wheels have.

    ``signs`` are what the encoders of left and right count, and ``swapped`` that each counts the other's wheel.
    """

    model: WheelModel = NOMINAL
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    slip: float = 1.0
    signs: tuple[int, int] = (1, 1)
    swapped: bool = False


def configured(path: Path = CONFIG) -> ConfiguredRobot:
    """The robot as this file says."""
    settings = load(path)
    return ConfiguredRobot(
        settings.chassis,
        settings.encoders,
        settings.drive,
        settings.gains(),
        settings.limits,
        settings.battery,
        0.18,
        imu=settings.imu,
        ultrasonic=settings.ultrasonic,
        infrared=settings.infrared,
        lidars=settings.lidar,
    )


class World:
    """Performs actions one after the other; ``pose`` is the robot's, ``now_s`` the time, ``trail`` both of each step."""

    def __init__(
        self, robot: ConfiguredRobot, truth: Truth, seed: int = 0, walls: Floats | None = None
    ) -> None:
        self.robot, self.truth = robot, truth
        self.now_s, self.pose = 100.0, np.array(MIDDLE)
        self._random = np.random.default_rng(seed)
        self._caster = RayCaster(furnished_flat() if walls is None else walls, 12.0)
        self._twist, self._counts = np.zeros(2), np.zeros(2)
        self._before_rad = np.zeros(2)
        self.trail = [(self.now_s, *self.pose)]

    def perform(
        self, procedure: Procedure, answers: Mapping[str, float] | None = None, most: int | None = None
    ) -> Measurements:
        """Everything that was measured during the procedure, or during so many of its actions."""
        wheels, scans, given = list[WheelsMeasured](), list[ScanMeasured](), {}
        action = next(procedure, None)
        performed = 0
        while action is not None and performed != most:
            performed += 1
            part = Measurements()
            if isinstance(action, Ask):
                given[action.key] = (answers or {})[action.key]
                part = Measurements(answers={action.key: given[action.key]})
            else:
                part = self._move(action)
                wheels += part.wheels
                scans += part.scans
            try:
                action = procedure.send(part)
            except StopIteration:
                break
        return Measurements(wheels=tuple(wheels), scans=tuple(scans), answers=given)

    def _move(self, move: Move) -> Measurements:
        wheels, scans = [], []
        steps = round(move.duration_s / STEP_S)
        target = np.zeros(2)
        if isinstance(move.motion, Twist2D):
            target = np.array([move.motion.linear_m_s, move.motion.angular_rad_s])
        for k in range(steps + (16 if move.motion is not None and move.settled else 0)):
            wheels.append(self._step(target if k < steps else np.zeros(2)))
            if len(self.trail) % round(TURN_S / STEP_S) == 0:
                scans.append(self._look())
        return Measurements(wheels=tuple(wheels), scans=tuple(scans))

    def _step(self, target: Floats) -> WheelsMeasured:
        most = np.array([1.0, 2.0]) * STEP_S
        self._twist = self._twist + np.clip(target - self._twist, -most, most)
        track_m, radius_m = self.robot.chassis.effective_track_m, self.robot.chassis.wheels[0].radius_m
        half_m = self._twist[1] * track_m / 2
        turned_rad = np.array([self._twist[0] - half_m, self._twist[0] + half_m]) * STEP_S / radius_m
        self._roll(turned_rad * radius_m)
        self._counts += turned_rad * self.robot.encoders.counts_per_turn / math.tau
        counts = np.floor(self._counts)[::-1] if self.truth.swapped else np.floor(self._counts)
        position = counts * self.truth.signs * math.tau / self.robot.encoders.counts_per_turn
        travel, self._before_rad = position - self._before_rad, position
        self.now_s += STEP_S
        self.trail.append((self.now_s, *self.pose))
        return WheelsMeasured(
            self.now_s, self.now_s, self.now_s, tuple(position), tuple(travel), tuple(turned_rad / STEP_S)
        )

    def _roll(self, rim_m: Floats) -> None:
        """Move as wheels do that scatter: by travel and by turn, as in the OptiOdom recordings."""
        model, slip = self.truth.model, self.truth.slip
        track_m = self.robot.chassis.effective_track_m * model.track
        rolled = rim_m * [model.left, model.right]
        rolled = rolled + slip * np.sqrt(6e-7 * np.abs(rolled)) * self._random.normal(0, 1, 2)
        turned = (rolled[1] - rolled[0]) / track_m
        turned += slip * math.sqrt(2.5e-5 * abs(turned)) * self._random.normal()
        ahead, along = rolled.mean(), self.pose[2] + turned / 2
        self.pose = self.pose + np.array([ahead * math.cos(along), ahead * math.sin(along), turned])

    def _look(self) -> ScanMeasured:
        """A turn of the lidar that has just ended, each beam from where the robot was."""
        after_s = np.linspace(-TURN_S, 0.0, BEAMS, endpoint=False)
        trail = np.array(self.trail[-8:])
        poses = [np.interp(self.now_s + after_s, trail[:, 0], column) for column in trail[:, 1:].T]
        x, y, yaw = self.truth.mount
        cos, sin = np.cos(poses[2]), np.sin(poses[2])
        origins = np.stack([poses[0] + cos * x - sin * y, poses[1] + sin * x + cos * y], axis=1)
        bearing = math.tau * np.arange(BEAMS) / BEAMS
        ranges = self._caster.cast(origins, poses[2] + yaw + bearing).range_m
        ranges = ranges + self._random.normal(0, NOISE_M, BEAMS)
        scan = LaserScan(self.now_s, bearing, ranges, after_s)
        return ScanMeasured(self.now_s, self.robot.lidars[0].name, ORIGIN, scan)
