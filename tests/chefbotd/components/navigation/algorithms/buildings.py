"""Five buildings as walls (n, 4: x, y, x, y), each another for each seed, but for the flat."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.chefbotd.components.mapping.algorithms.slam.flat import Floats, box, furnished_flat, wall


@dataclass(frozen=True, slots=True)
class Building:
    """What it is called, its walls and furniture, and its size."""

    name: str
    walls: Floats
    width_m: float
    depth_m: float


def flat(seed: int) -> Building:
    """Five furnished rooms around a corridor, as in the tests of SLAM."""
    return Building("flat", furnished_flat(), 10.4, 8.1)


def corridor(seed: int) -> Building:
    """A corridor 1.5 m wide with three rooms on either side, doors 0.75 to 0.9 m wide, and one room without a door."""
    chance = np.random.default_rng(seed)
    parts = [box(0, 0, 13.0, 7.5)]
    for y, depth in ((3.0, -3.0), (4.5, 3.0)):
        for k in range(3):
            left, right = k * 13 / 3, (k + 1) * 13 / 3
            door, width = left + chance.uniform(0.5, 2.6), chance.uniform(0.75, 0.9)
            if (k, y) == (1, 4.5):
                parts.append(wall((left, y), (right, y)))
            else:
                parts += [wall((left, y), (door, y)), wall((door + width, y), (right, y))]
            if k:
                parts.append(wall((left, y), (left, y + depth)))
            far = 0.3 if depth < 0 else 6.4
            parts.append(box(left + chance.uniform(0.4, 2.6), far, 1.2, 0.7))
    return Building("corridor", np.vstack(parts), 13.0, 7.5)


def office(seed: int) -> Building:
    """Desks in rows, back to back, with chairs drawn up or not; pillars; a meeting room with a door of 0.85 m."""
    chance = np.random.default_rng(100 + seed)
    parts = [box(0, 0, 12.0, 9.0), wall((8.5, 0), (8.5, 1.2)), wall((8.5, 2.05), (8.5, 3.6), (12.0, 3.6))]
    parts += [box(9.4, 1.3, 1.6, 0.9), box(6.0, 4.4, 0.4, 0.4)]
    for x in (1.2, 4.2):
        for y in (1.2, 4.0, 6.8):
            parts.append(box(x, y, 1.5, 0.8))
            parts.append(
                box(
                    x + chance.uniform(0.1, 1.0),
                    y - chance.uniform(0.35, 0.6),
                    0.4,
                    0.4,
                    chance.uniform(0, 0.6),
                )
            )
    for x in (7.6, 9.8):
        parts.append(box(x, 6.0, 0.8, 1.6))
    return Building("office", np.vstack(parts), 12.0, 9.0)


def restaurant(seed: int) -> Building:
    """Twelve tables with chairs around them, somewhat out of place, and a kitchen behind a counter."""
    chance = np.random.default_rng(200 + seed)
    parts = [
        box(0, 0, 11.0, 9.0),
        wall((0, 7.2), (3.0, 7.2)),
        wall((3.9, 7.2), (9.0, 7.2)),
        box(0.2, 8.3, 5.0, 0.5),
    ]
    for x in (1.6, 4.2, 6.8, 9.4):
        for y in (1.4, 3.5, 5.6):
            cx, cy = x + chance.uniform(-0.15, 0.15), y + chance.uniform(-0.1, 0.1)
            turn = chance.uniform(-0.2, 0.2)
            parts.append(_placed(-0.35, -0.35, 0.7, 0.7, cx, cy, turn))
            for side in (-1, 1):
                out = side * chance.uniform(0.45, 0.65)
                parts.append(_placed(out - 0.2, -0.2, 0.4, 0.4, cx, cy, turn))
    return Building("restaurant", np.vstack(parts), 11.0, 9.0)


def clutter(seed: int) -> Building:
    """A hall with 32 boxes anywhere, at any angle."""
    chance = np.random.default_rng(300 + seed)
    parts = [box(0, 0, 9.0, 8.0)]
    for _ in range(32):
        x, y = chance.uniform(0.3, 8.5), chance.uniform(0.3, 7.5)
        size = chance.uniform(0.08, 0.7, 2)
        parts.append(_placed(-size[0] / 2, -size[1] / 2, *size, x, y, chance.uniform(0, math.pi)))
    walls = np.clip(np.vstack(parts), 0, [9.0, 8.0, 9.0, 8.0])
    return Building("clutter", walls, 9.0, 8.0)


def _placed(x: float, y: float, width: float, depth: float, cx: float, cy: float, turn_rad: float) -> Floats:
    """A box about a middle, turned about that."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    return box(cx + cos * x - sin * y, cy + sin * x + cos * y, width, depth, turn_rad)


BUILDINGS: tuple[Callable[[int], Building], ...] = (flat, corridor, office, restaurant, clutter)
