"""The office: eight rooms off a long corridor, most of them alike, 24 by 9 m; the origin is its lower left inner corner.

What is hard about it: the corridor looks the same for metres, and one room like the next.
"""

import math
from collections.abc import Iterator

from chefbotd.components.simulation.worlds.building import (
    Building,
    Door,
    Material,
    Placement,
    Solid,
    box,
    chair,
    column,
    level_door,
    level_wall,
    table,
    upright_wall,
)
from chefbotd.core.geometry import Pose2D

OUTER_M = 0.2
SOUTH_Y_M, NORTH_Y_M = 3.5, 5.3
ROOM_M = 6.0

SOUTH = tuple(Door(f"room {k + 1}", ROOM_M * k + 4.4, 0.9) for k in range(4))
NORTH = tuple(Door(f"room {k + 5}", ROOM_M * k + 1.1, 0.9) for k in range(4))


def _workplace(x_m: float, y_m: float) -> Iterator[Solid]:
    yield from table("desk", Placement(x_m, y_m), 1.6, 0.8)
    yield from chair("chair", Placement(x_m + 0.6, y_m + 0.9, math.pi * 1.5 + 0.1))


OFFICE = Building(
    "office",
    (
        *level_wall(-OUTER_M, -OUTER_M, 24.0 + OUTER_M, thick_m=OUTER_M),
        *level_wall(9.0, -OUTER_M, 24.0 + OUTER_M, thick_m=OUTER_M),
        *upright_wall(-OUTER_M, 0.0, 9.0, thick_m=OUTER_M),
        *upright_wall(24.0, 0.0, 9.0, thick_m=OUTER_M),
        *level_wall(SOUTH_Y_M, 0.0, 24.0, SOUTH),
        *level_wall(NORTH_Y_M, 0.0, 24.0, NORTH),
        *[wall for k in (1, 2, 3) for wall in upright_wall(ROOM_M * k, 0.0, SOUTH_Y_M)],
        *[wall for k in (1, 2, 3) for wall in upright_wall(ROOM_M * k, NORTH_Y_M + 0.1, 9.0)],
        *[part for k in range(4) for part in _workplace(ROOM_M * k + 0.8, 0.3)],
        *[part for k in range(3) for part in _workplace(ROOM_M * k + 3.2, 6.4)],
        box("copier", Placement(23.2, 4.6), 0.7, 0.6, 1.1, material=Material.BLACK),
        column("plant", 0.35, 5.0, 0.2, 1.2),
        *table("meeting table", Placement(20.2, 6.6, 0.1), 2.4, 1.2),
    ),
    doors=(*[level_door(door, SOUTH_Y_M) for door in SOUTH], *[level_door(door, NORTH_Y_M) for door in NORTH]),
    start=Pose2D(1.5, 4.5, 0.1),
    rooms={
        "corridor": (3.0, 4.4),
        **{door.name: (door.at_m + 0.45, 2.6) for door in SOUTH},
        **{door.name: (door.at_m + 0.45, 6.1) for door in NORTH},
    },
    tour=(
        (1.5, 4.5), (4.85, 4.4), (4.85, 2.3), (4.85, 4.4), (10.85, 4.4), (10.85, 2.3), (10.85, 4.4), (13.55, 4.4),
        (13.55, 6.3), (13.55, 4.4), (22.85, 4.35), (22.85, 2.3), (22.85, 4.35), (19.55, 4.5), (19.55, 6.1),
        (19.55, 4.5), (16.85, 4.4), (16.85, 2.3), (16.85, 4.4), (7.55, 4.4), (7.55, 6.2), (7.55, 4.4), (1.55, 4.4),
        (1.55, 6.2), (1.55, 4.4),
    ),
)  # fmt: skip
