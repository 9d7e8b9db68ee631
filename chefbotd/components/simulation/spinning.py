"""A spinning lidar: each point is measured from the lidar's position at that instant, and sent in its protocol.

The motor turns clockwise seen from above. Chance and angles depend on a point's number alone, so how often the lidar is
asked changes nothing.
"""

import math
from abc import ABC, abstractmethod
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.parameters.simulation import (
    GLASS_SQUARE,
    LONE_INTENSITY,
    LONE_RANGE_M,
    WOBBLE_S,
    LidarFlaws,
)
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.world import RayCaster, to_discs_m
from chefbotd.components.simulation.worlds.building import Material
from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.record import Record, replace

BRIGHT, DIM, GLINT = 200, 40, 120
"""Intensities of a plain surface, a black one and glass (assumed)."""


def interpolate_poses(at_s: Vector, trail: Vector) -> Vector:
    """Where the robot was (n, 3: x, y, heading) at rising times, by ``np.interp``'s rule, in one piece.

    ``trail`` has rows of time, x, y, heading, with rising times.
    """
    if len(trail) == 1:
        return np.repeat(trail[:, 1:], len(at_s), axis=0)
    step = trail[1:] - trail[:-1]
    slope = step[:, 1:] / step[:, :1]
    place = np.minimum(trail[1:-1, 0].searchsorted(at_s, side="right"), len(step) - 1)
    since_s = np.minimum(np.maximum(at_s, trail[0, 0]), trail[-1, 0]) - trail[place, 0]
    poses: Vector = slope[place] * since_s[:, None] + trail[place, 1:]
    return poses


class BeamReturns(Record, frozen=True):
    """The range of each beam in metres (inf: nothing comes back), and its intensity."""

    range_m: Vector
    intensity: npt.NDArray[np.int64]


class Sight:
    """A scene as the beams of a lidar at this height see it, with the discs that move about in it."""

    def __init__(self, scene: Scene, height_m: float, flaws: LidarFlaws) -> None:
        edges, material = scene.slice(height_m)
        glass = material == Material.GLASS
        self._flaws, self._opaque = flaws, int(np.count_nonzero(~glass))
        self._black = material[~glass] == Material.BLACK
        self._has_black = bool(self._black.any())
        self._walls = RayCaster(np.concatenate((edges[~glass], edges[glass])), flaws.max_range_m)

    def cast_beams(self, origins: Vector, bearings_rad: Vector, discs: Vector) -> BeamReturns:
        """The echoes of beams from ``origins`` (B x 2), whose bearings in the world frame rise or fall."""
        hits, pane = self._walls.cast_apart(origins, bearings_rad, self._opaque)
        range_m, intensity = hits.range_m, np.full(len(bearings_rad), BRIGHT)
        if self._has_black:
            black = (hits.edge >= 0) & self._black[hits.edge]
            intensity[black] = DIM
            range_m = np.where(black & (range_m > self._flaws.black_range_m), np.inf, range_m)
        if len(discs):
            to_disc_m = to_discs_m(origins, bearings_rad, discs)
            nearer = to_disc_m < hits.range_m
            range_m, intensity[nearer] = np.where(nearer, to_disc_m, range_m), BRIGHT
        if pane is not None:
            mirrors = (pane.range_m < range_m) & (pane.square >= GLASS_SQUARE)
            range_m, intensity[mirrors] = np.where(mirrors, pane.range_m, range_m), GLINT
        return BeamReturns(range_m, intensity)


LONGEST_GAP_S = 0.4
"""What was not asked for within this time is not measured: the robot's trail is not kept for longer."""


class LidarWire(StrEnum):
    """Whose bytes it sends."""

    LD19 = "ld19"
    RPLIDAR_A1 = "rplidar_a1"
    RPLIDAR_A2 = "rplidar_a2"


class LidarMount(Record, frozen=True):
    """Where a lidar sits: its name, its axis seen from the base, and the height at which it looks; which one it is.

    The heading is where its zero mark points, seen from above, also if it hangs upside down. It reads ``range_scale``
    times the range, and ``range_offset_m`` more; ``lone_share`` of its beams is noise, beside what its flaws say.
    """

    name: str = "lidar"
    base_from_lidar: Pose2D = ORIGIN
    upside_down: bool = False
    height_m: float = 0.2
    wire: LidarWire = LidarWire.LD19
    range_offset_m: float = 0.0
    range_scale: float = 1.0
    lone_share: float = 0.0


class SpinningLidar(ABC):
    """Powered on at time 0, at full speed. ``packets_skipped`` counts those that were asked for too late.

    ``points`` are in a packet, which takes ``transmission_s`` on the wire.
    """

    points: int
    transmission_s: float
    turn_packets: int
    """The approximate number of packets in a turn."""

    def __init__(self, flaws: LidarFlaws, mount: LidarMount, sight: Sight, seed: int) -> None:
        self._flaws, self._mount, self._sight = flaws, mount, sight
        self._noise, self._luck, drawn = (np.random.default_rng((seed, number)) for number in range(3))
        self._lone, self._lone_share = np.random.default_rng((seed, 3)), flaws.lone_share + mount.lone_share
        self._rate_hz = flaws.turns_per_s * (1 + flaws.rate_error_share * float(drawn.standard_normal()))
        self._first_turn = float(drawn.random())
        self._packets = 0
        self._stalled_s, self._stalled_at_s = 0.0, math.inf
        self.packets_skipped = 0
        self.turn_packets = math.ceil(flaws.points_per_s / flaws.turns_per_s / self.points)

    def _send_packets_of(self, points: int, transmission_s: float, points_per_s: float) -> None:
        """Change the points of a packet and the rate of points, from the next point on."""
        at_s = self.measured_s
        self.points, self.transmission_s = points, transmission_s
        self._flaws = self._flaws.model_copy(update={"points_per_s": points_per_s})
        self._packets = math.ceil(at_s * points_per_s / points - 1e-9)

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host and return the immediate answer. Most lidars answer nothing and send unasked."""
        return b""

    def stall(self, at_s: float) -> None:
        """Hold the motor."""
        self._stalled_at_s = min(at_s, self._stalled_at_s)

    def release(self, at_s: float) -> None:
        """Let the motor turn again."""
        self._stalled_s += max(at_s - self._stalled_at_s, 0.0)
        self._stalled_at_s = math.inf

    @property
    def is_stalled(self) -> bool:
        """Whether something holds the motor."""
        return math.isfinite(self._stalled_at_s)

    def turn(self, by_rad: float) -> None:
        """Turn it in its mount, so that its zero mark points elsewhere (CCW positive)."""
        mount = self._mount
        turned = mount.base_from_lidar.compose(Pose2D(0.0, 0.0, by_rad))
        self._mount = replace(mount, base_from_lidar=turned)

    @property
    def measured_s(self) -> float:
        """When the next point is measured."""
        return self._packets * self.points / self._flaws.points_per_s

    def packets_left(self, to_s: float) -> int:
        """The number of packets that have left the lidar by this time."""
        points = (to_s - self.transmission_s) * self._flaws.points_per_s + 1
        return max(math.floor(points / self.points + 1e-9), 0)

    def send_packets(self, to_s: float, trail: Vector, discs: Vector) -> list[bytes]:
        """The packets that left since the last call.

        Args:
            to_s: the time, from power-on.
            trail: where the robot was: rows of time, x, y, heading (not wrapped), with rising times.
            discs: who and what stands about now (D x 3: x, y, radius).
        """
        end = self.packets_left(to_s)
        begin = max(self._packets, self.packets_left(to_s - LONGEST_GAP_S))
        self.packets_skipped += begin - self._packets
        self._pass_over((begin - self._packets) * self.points)
        self._packets = max(end, begin)
        if end <= begin:
            return []
        if not self.sends:
            self._pass_over((end - begin) * self.points)
            return []
        point_s = np.arange(begin * self.points, end * self.points) / self._flaws.points_per_s
        turned = self._turned(point_s)
        seen = self._look(point_s, turned, trail, discs)
        distance_m = self._distances_m(seen)
        intensity = np.where(distance_m > 0, seen.intensity, 0)
        if self._lone_share:
            self._add_noise(distance_m, intensity)
        return self._packed(point_s, turned, distance_m, intensity)

    @property
    def sends(self) -> bool:
        """Whether it sends what it measures."""
        return True

    @abstractmethod
    def _packed(self, point_s: Vector, turned: Vector, distance_m: Vector, intensity: Vector) -> list[bytes]:
        """Points as packets: when, after how many turns, how far (0: no reading) and how bright."""

    def _pass_over(self, points: int) -> None:
        """Draw the random numbers of points that nobody reads, so that later points stay the same."""
        if points:
            self._noise.standard_normal(points)
            self._luck.random(points)
            if self._lone_share:
                self._lone.random((points, 3))

    def _turned(self, at_s: Vector) -> Vector:
        """The number of turns of the motor so far."""
        running_s = np.minimum(at_s, self._stalled_at_s) - self._stalled_s
        pace = math.tau / WOBBLE_S
        wobble_s = self._flaws.rate_wobble_share / pace * (1 - np.cos(pace * running_s))
        turned: Vector = self._first_turn + self._rate_hz * (running_s + wobble_s)
        return turned

    def _look(self, point_s: Vector, turned: Vector, trail: Vector, discs: Vector) -> BeamReturns:
        x, y, base_rad = interpolate_poses(point_s, trail).T
        mount, cos, sin = self._mount.base_from_lidar, np.cos(base_rad), np.sin(base_rad)
        origins = np.empty((len(x), 2))
        origins[:, 0] = x + cos * mount.x_m - sin * mount.y_m
        origins[:, 1] = y + sin * mount.x_m + cos * mount.y_m
        sense = 1.0 if self._mount.upside_down else -1.0
        bearings = base_rad + mount.heading_rad + sense * math.tau * (turned - math.floor(turned[0]))
        return self._sight.cast_beams(origins, bearings, discs)

    def _distances_m(self, seen: BeamReturns) -> Vector:
        """Ranges with the lidar's noise and resolution; 0 is no reading."""
        count, flaws = len(seen.range_m), self._flaws
        range_m = seen.range_m * self._mount.range_scale + self._mount.range_offset_m
        range_m += flaws.noise_m * self._noise.standard_normal(count)
        lost = self._luck.random(count) < flaws.lost_share
        lost |= (range_m < flaws.min_range_m) | (range_m > flaws.max_range_m)
        measured: Vector = np.where(lost, 0.0, range_m)
        return measured

    def _add_noise(self, distance_m: Vector, intensity: Vector) -> None:
        """Replace some readings by lone weak ones, as sunlight does."""
        drawn = self._lone.random((len(distance_m), 3))
        is_lone = drawn[:, 0] < self._lone_share
        nearest_m, farthest_m = LONE_RANGE_M
        distance_m[is_lone] = nearest_m + (farthest_m - nearest_m) * drawn[is_lone, 1]
        intensity[is_lone] = 1 + np.floor(drawn[is_lone, 2] * LONE_INTENSITY)
