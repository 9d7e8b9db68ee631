"""The flat: six furnished rooms, a hall, a balcony behind glass, 10 by 8 m; the origin is its lower left inner corner.

y
8 +-----------+---------+-------------+
  |  bedroom  |  study     child's    |     rooms open into the hall; so do living room and kitchen into each other,
  |           |         |  room       |     and study and child's room: two loops
4.7 --------d-+--d------+-----d-------+
  |  hall                             |
3.4 -----d---------+----d---+--d------+
  |  living room   | kitchen|  bath   |
0 |  glass         d        |         |
  +----------------+--------+---------+
-1.5 balcony                            x 0 to 10
"""

import math

from chefbotd.components.simulation.worlds.building import (
    CEILING_M,
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
    upright_door,
    upright_wall,
)
from chefbotd.core.geometry import Pose2D

SOUTH_Y_M, NORTH_Y_M = 3.3, 4.6
OUTER_M = 0.2

LIVING_ROOM = Door("living room", 1.9, 0.9)
KITCHEN = Door("kitchen", 6.2, 0.86)
BATH = Door("bath", 8.6, 0.8)
BEDROOM = Door("bedroom", 2.3, 0.86)
STUDY = Door("study", 4.5, 0.86)
CHILDS_ROOM = Door("child's room", 8.0, 0.9)
SERVING_HATCH = Door("living room to kitchen", 1.0, 0.9)
CONNECTING = Door("study to child's room", 6.5, 0.86)

WALLS: tuple[Solid, ...] = (
    *level_wall(8.0, -OUTER_M, 10.0 + OUTER_M, thick_m=OUTER_M),
    *upright_wall(-OUTER_M, -OUTER_M, 8.0, thick_m=OUTER_M),
    *upright_wall(10.0, -OUTER_M, 8.0, thick_m=OUTER_M),
    *level_wall(-OUTER_M, 0.0, 10.0, (Door("window front", 0.8, 3.4),), thick_m=OUTER_M),
    *level_wall(SOUTH_Y_M, 0.0, 10.0, (LIVING_ROOM, KITCHEN, BATH)),
    *level_wall(NORTH_Y_M, 0.0, 10.0, (BEDROOM, STUDY, CHILDS_ROOM)),
    *upright_wall(4.9, 0.0, SOUTH_Y_M, (SERVING_HATCH,)),
    *upright_wall(7.6, 0.0, SOUTH_Y_M),
    *upright_wall(3.6, 4.7, 8.0),
    *upright_wall(6.2, 4.7, 8.0, (CONNECTING,)),
    box("chimney", Placement(9.5, 7.3), 0.5, 0.7, CEILING_M),
)

BALCONY: tuple[Solid, ...] = (
    *[
        box("glass", Placement(x, -0.14), 1.06, 0.04, CEILING_M, material=Material.GLASS)
        for x in (0.82, 1.96, 3.1)
    ],
    *[box("window frame", Placement(x, -0.16), 0.08, 0.08, CEILING_M) for x in (0.8, 1.88, 3.02, 4.14)],
    *level_wall(-1.6, 0.3, 4.7),
    *upright_wall(0.3, -1.5, -OUTER_M),
    *upright_wall(4.6, -1.5, -OUTER_M),
)

LIVING: tuple[Solid, ...] = (
    box("sofa", Placement(0.0, 0.5), 0.9, 2.0, 0.8),
    *table("coffee table", Placement(1.45, 1.0, 0.2), 0.56, 0.96, 0.42, 0.04),
    box("sideboard", Placement(3.1, 2.94), 1.4, 0.36, 0.6),
    *table("dining table", Placement(3.3, 0.55), 0.8, 1.2),
    *chair("chair", Placement(2.83, 0.75, -0.1)),
    *chair("chair", Placement(3.5, 2.2, 0.1 - math.pi / 2)),
    column("plant", 0.3, 2.95, 0.18, 0.9),
)

KITCHEN_FURNITURE: tuple[Solid, ...] = (
    box("kitchen block", Placement(5.6, 0.0), 2.0, 0.6, 0.9),
    box("fridge", Placement(7.0, 0.6), 0.6, 0.62, 1.8),
    *table("kitchen table", Placement(5.06, 2.5), 0.7, 0.74, 0.74, 0.05),
    *chair("stool", Placement(6.1, 3.05, math.pi + 0.4)),
)

BATH_FURNITURE: tuple[Solid, ...] = (
    box("bath tub", Placement(7.7, 0.0), 2.3, 0.75, 0.6),
    box("washing machine", Placement(7.7, 2.66), 0.6, 0.64, 0.85),
    box("washbasin", Placement(9.58, 1.6), 0.42, 0.55, 0.85, 0.62),
    box("toilet", Placement(7.7, 1.5), 0.56, 0.38, 0.45),
)

BEDROOM_FURNITURE: tuple[Solid, ...] = (
    box("bed", Placement(0.0, 5.5), 2.0, 1.6, 0.5),
    box("wardrobe", Placement(1.5, 7.4), 2.1, 0.6, 2.1, material=Material.BLACK),
    box("bedside table", Placement(0.0, 7.2), 0.42, 0.4, 0.5),
    *chair("chair", Placement(0.25, 4.76, 0.3)),
)

STUDY_FURNITURE: tuple[Solid, ...] = (
    *table("desk", Placement(3.72, 7.2), 1.5, 0.76),
    *chair("chair", Placement(4.7, 6.6, math.pi / 2 + 0.25)),
    box("bookshelf", Placement(5.88, 4.72), 0.32, 1.3, 2.0),
    box("paper basket", Placement(3.8, 5.6), 0.26, 0.26, 0.35),
)

CHILDS_FURNITURE: tuple[Solid, ...] = (
    box("bed", Placement(9.1, 5.1), 0.9, 2.0, 0.45),
    box("toy chest", Placement(7.0, 5.0, 0.5), 0.7, 0.4, 0.45),
    *table("low table", Placement(7.3, 7.0, -0.35), 0.7, 0.6, 0.55, 0.05),
    box("drawers", Placement(6.34, 7.56), 0.8, 0.44, 0.9, material=Material.BLACK),
)

HALL_FURNITURE: tuple[Solid, ...] = (
    box("shoe cabinet", Placement(0.0, 3.4), 0.34, 0.8, 1.0),
    column("coat stand", 7.5, 4.4, 0.14, 1.8),
    box("chest", Placement(3.7, 3.4), 0.9, 0.28, 0.7),
    box("end of the hall", Placement(9.7, 3.4), 0.3, 0.5, 2.0),
)

TOUR = (
    (2.5, 2.4), (2.35, 2.9), (2.35, 4.0), (2.72, 4.25), (2.75, 5.1), (2.6, 6.8), (2.75, 5.1), (2.72, 4.1),
    (4.9, 4.05), (4.93, 5.1), (5.1, 6.1), (5.6, 6.93), (6.7, 6.93), (7.2, 6.25), (8.35, 6.3), (8.45, 5.3),
    (8.45, 3.9), (8.98, 3.8), (9.0, 2.8), (8.9, 1.3), (9.0, 2.8), (8.98, 3.9), (6.65, 3.9), (6.62, 2.9),
    (6.55, 1.5), (5.45, 1.45), (4.5, 1.45), (4.45, 2.57), (3.0, 2.57), (1.2, 2.8), (2.35, 2.8), (2.35, 3.95),
    (1.0, 3.95), (2.35, 3.95), (2.4, 2.9), (2.5, 2.4),
)  # fmt: skip
"""A drive through every room and round both loops, straight from point to point."""

FLAT = Building(
    "flat",
    (
        *WALLS,
        *BALCONY,
        *LIVING,
        *KITCHEN_FURNITURE,
        *BATH_FURNITURE,
        *BEDROOM_FURNITURE,
        *STUDY_FURNITURE,
        *CHILDS_FURNITURE,
        *HALL_FURNITURE,
    ),
    doors=(
        level_door(LIVING_ROOM, SOUTH_Y_M),
        level_door(KITCHEN, SOUTH_Y_M),
        level_door(BATH, SOUTH_Y_M),
        level_door(BEDROOM, NORTH_Y_M),
        level_door(STUDY, NORTH_Y_M),
        level_door(CHILDS_ROOM, NORTH_Y_M),
        upright_door(SERVING_HATCH, 4.9),
        upright_door(CONNECTING, 6.2),
    ),
    start=Pose2D(2.5, 2.4, 1.8),
    rooms={
        "living room": (2.4, 2.4),
        "kitchen": (6.4, 1.6),
        "bath": (9.0, 1.8),
        "bedroom": (2.7, 6.0),
        "study": (5.2, 5.9),
        "child's room": (8.3, 6.4),
        "hall": (5.6, 4.0),
    },
    tour=TOUR,
    outside=((2.4, -0.8),),
)
