"""The robot's outline seen from above, and when a point touches it as the robot moves."""

import math
from functools import lru_cache
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import Record

Floats: TypeAlias = NDArray[np.float64]


class Outline(Protocol):
    """A shape about the robot's origin. Points are given by their x and y in the robot's frame."""

    @property
    def radius_m(self) -> float:
        """How far its farthest point is from the origin."""
        ...

    def grown(self, by_m: float) -> "Outline":
        """The same shape, larger by this much on every side."""
        ...

    def distances(self, x: Floats, y: Floats) -> Floats:
        """How far outside the points are; negative inside. At a corner a little less than the true distance."""
        ...

    def closing_speed_m_s(self, x: Floats, y: Floats, twist: Twist2D) -> Floats:
        """How fast each point comes closer to the outline, in m/s; negative: it goes away."""
        ...

    def straight_ways(self, x: Floats, y: Floats, *, forward: bool) -> Floats:
        """Metres that may be driven straight until each point touches; infinity: it never does."""
        ...

    def arc_angles(self, x: Floats, y: Floats, centre_m: float, *, left: bool) -> Floats:
        """Radians that may be turned until each point touches; infinity: it never does.

        The centre of the turn is at (0, ``centre_m``); turned is to the ``left`` or to the right.
        """
        ...


class Disc(Record, frozen=True):
    """A round robot."""

    radius_m: float

    def grown(self, by_m: float) -> "Disc":
        """A larger disc."""
        return Disc(self.radius_m + by_m)

    def distances(self, x: Floats, y: Floats) -> Floats:
        """From the rim."""
        distances: Floats = np.hypot(x, y) - self.radius_m
        return distances

    def closing_speed_m_s(self, x: Floats, y: Floats, twist: Twist2D) -> Floats:
        """Turning brings nothing closer to a disc."""
        closing: Floats = twist.linear_m_s * x / np.maximum(np.hypot(x, y), 1e-9)
        return closing

    def straight_ways(self, x: Floats, y: Floats, *, forward: bool) -> Floats:
        """To where the line through the point enters the disc."""
        ahead = x if forward else -x
        inside = self.radius_m**2 - y * y
        free_m = ahead - np.sqrt(np.maximum(inside, 0.0))
        return np.where((inside > 0) & (ahead > 0), np.maximum(free_m, 0.0), np.inf)

    def arc_angles(self, x: Floats, y: Floats, centre_m: float, *, left: bool) -> Floats:
        """By the law of cosines, in the triangle of origin, centre of the turn and point."""
        angles, from_centre = np.full(len(x), np.inf), y - centre_m
        radius = np.hypot(x, from_centre)
        product = 2 * abs(centre_m) * radius
        cosine = (self.radius_m**2 - centre_m**2 - radius * radius) / np.maximum(product, 1e-12)
        (touching,) = ((np.abs(cosine) <= 1) & (product > 1e-12)).nonzero()  # few of a room's points
        half = np.arccos(cosine[touching])
        outwards = math.copysign(math.pi / 2, centre_m)  # from the origin to the centre of the turn, and on
        now = np.arctan2(from_centre[touching], x[touching])
        # In the robot's frame the points turn the other way round than the robot does.
        sense = -1.0 if left else 1.0
        both = [(sense * (outwards + side * half - now)) % math.tau for side in (1.0, -1.0)]
        angles[touching] = np.minimum(*both)
        return angles


class Box(Record, frozen=True):
    """A robot with four sides; its middle is the origin."""

    half_length_m: float
    half_width_m: float

    @property
    def radius_m(self) -> float:
        """To a corner."""
        return math.hypot(self.half_length_m, self.half_width_m)

    def grown(self, by_m: float) -> "Box":
        """A larger box, with sharp corners."""
        return Box(self.half_length_m + by_m, self.half_width_m + by_m)

    def distances(self, x: Floats, y: Floats) -> Floats:
        """From the side that it is farthest beyond."""
        distances: Floats = np.maximum(np.abs(x) - self.half_length_m, np.abs(y) - self.half_width_m)
        return distances

    def closing_speed_m_s(self, x: Floats, y: Floats, twist: Twist2D) -> Floats:
        """Towards the side that it is farthest beyond."""
        at_end = np.abs(x) - self.half_length_m > np.abs(y) - self.half_width_m
        along = np.sign(x) * (twist.linear_m_s - twist.angular_rad_s * y)
        across = np.sign(y) * twist.angular_rad_s * x
        return np.where(at_end, along, across)

    def straight_ways(self, x: Floats, y: Floats, *, forward: bool) -> Floats:
        """To the front, or to the back."""
        ahead = (x if forward else -x) - self.half_length_m
        return np.where((np.abs(y) < self.half_width_m) & (ahead >= 0), ahead, np.inf)

    def arc_angles(self, x: Floats, y: Floats, centre_m: float, *, left: bool) -> Floats:
        """To the first of its sides that the circle of the point crosses."""
        angles, from_centre = np.full(len(x), np.inf), y - centre_m
        to_flank_m = abs(centre_m) - self.half_width_m
        nearest_m = to_flank_m if to_flank_m > 0 else min(-to_flank_m, self.half_length_m)
        farthest_m = math.hypot(self.half_length_m, abs(centre_m) + self.half_width_m)
        crossed = _on_ring(x, from_centre, nearest_m, farthest_m)
        x, from_centre = x[crossed], from_centre[crossed]
        radius = np.maximum(np.hypot(x, from_centre), 1e-12)
        now = np.arctan2(from_centre, x)
        sense = -1.0 if left else 1.0
        touched, on_side = self._crossings(radius, centre_m)
        turned = (sense * (touched - now)) % math.tau
        angles[crossed] = np.where(on_side, turned, np.inf).min(axis=0)
        return angles

    def _crossings(self, radius: Floats, centre_m: float) -> tuple[Floats, NDArray[np.bool_]]:
        """Eight angles for each point at which its circle crosses a side's line, and whether that is on the side."""
        along_m, across_m = _sides(self.half_length_m, self.half_width_m)
        cosine, sine = along_m / radius, (across_m - centre_m) / radius
        to_ends = np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0))
        to_flanks = np.arcsin(np.minimum(np.maximum(sine, -1.0), 1.0))
        angles = np.concatenate([to_ends, -to_ends, to_flanks, math.pi - to_flanks])
        end_y = np.sqrt(np.maximum(radius * radius - along_m * along_m, 0.0))
        flank_x = np.sqrt(np.maximum(radius * radius - (across_m - centre_m) ** 2, 0.0))
        ends, flanks = np.abs(cosine) <= 1, (np.abs(sine) <= 1) & (flank_x <= self.half_length_m)
        above = ends & (np.abs(centre_m + end_y) <= self.half_width_m)
        below = ends & (np.abs(centre_m - end_y) <= self.half_width_m)
        return angles, np.concatenate([above, below, flanks, flanks])


RING_MARGIN_M = 1e-6


def _on_ring(x: Floats, from_centre: Floats, nearest_m: float, farthest_m: float) -> NDArray[np.intp]:
    """The points whose way about the centre of a turn can meet the outline: most of a room's points never do."""
    squared = x * x + from_centre * from_centre
    low_m = max(nearest_m - RING_MARGIN_M, 0.0)
    return ((squared >= low_m**2) & (squared <= (farthest_m + RING_MARGIN_M) ** 2)).nonzero()[0]


@lru_cache(maxsize=8)
def _sides(half_length_m: float, half_width_m: float) -> tuple[Floats, Floats]:
    """Where the ends and the flanks are, as columns."""
    return (
        np.array([[half_length_m], [-half_length_m]]),
        np.array([[half_width_m], [-half_width_m]]),
    )
