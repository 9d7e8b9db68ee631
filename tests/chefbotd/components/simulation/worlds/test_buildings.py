"""The buildings that come with the simulator, and the map files drawn from them."""

import io
import math
from collections import deque
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chefbotd.components.maps.algorithms.map_server import parse_description, parse_image
from chefbotd.components.simulation.rooms import BUILDINGS, scene_of
from chefbotd.components.simulation.worlds import draw
from chefbotd.components.simulation.worlds.building import Building
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

ROBOT_M = 0.18
FOLDER = Path(draw.__file__).parent
EACH = pytest.mark.parametrize("building", BUILDINGS.values(), ids=BUILDINGS)


def shipped(name: str) -> OccupancyGrid:
    """The map that comes with chefbotd under this name."""
    description = parse_description((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"), name)
    return parse_image((FOLDER / description.image).read_bytes(), description)


@EACH
def test_the_shipped_map_is_the_one_that_the_table_draws(building: Building) -> None:
    """Whoever changes a building draws its map again."""
    there, drawn = shipped(building.name), building.grid()
    assert (there.resolution_m, there.map_from_grid) == (drawn.resolution_m, drawn.map_from_grid)
    assert (there.percent == drawn.percent).all()


def test_the_table_writes_the_files_into_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """YAML and image of each building, both of which map_server reads: an 8-bit grey PNG of three shades."""
    draw.main(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "flat.yaml",
        "flat.png",
        "office.yaml",
        "office.png",
    }
    with Image.open(io.BytesIO((tmp_path / "flat.png").read_bytes())) as image:
        assert (image.mode, image.size, {shade for _, shade in image.getcolors()}) == (
            "L",
            (540, 510),
            {0, 205, 254},
        )
    assert str(tmp_path / "flat.yaml") in capsys.readouterr().out


def test_the_flats_map_is_as_the_table_says() -> None:
    """By hand: sofa (0 to 0.9, 0.5 to 2.5), the wall beside the hall's door at (1.8, 3.35), the door (2.3, 3.35)."""
    grid = shipped("flat")
    expected = {
        (0.45, 1.5): OCCUPIED,
        (1.0, 1.5): FREE,
        (1.8, 3.35): OCCUPIED,
        (2.3, 3.35): FREE,
        (1.3, -0.12): OCCUPIED,  # glass
        (1.3, -0.7): FREE,  # the balcony behind it
        (6.0, -0.7): -1,
        (3.7, 1.2): FREE,  # below the dining table's top
        (3.33, 0.58): OCCUPIED,  # its leg
        (9.8, 1.8): FREE,  # below the washbasin
    }
    corner = grid.map_from_grid
    for (x, y), value in expected.items():
        row, column = int((y - corner.y_m) / 0.02), int((x - corner.x_m) / 0.02)
        assert grid.percent[row, column] == value, (x, y)


@EACH
def test_a_robot_reaches_every_room(building: Building) -> None:
    """A disc 5 cm wider than the robot on each side finds a way from the start to a point of every room."""
    world, step_m = scene_of(Path(building.name)).below(0.35), 0.1
    start = (round(building.start.x_m / step_m), round(building.start.y_m / step_m))
    reached, edge = {start}, deque([start])
    while edge:
        x, y = edge.popleft()
        for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if (
                cell not in reached
                and world.clearance_m((cell[0] * step_m, cell[1] * step_m)) > ROBOT_M + 0.05
            ):
                reached.add(cell)
                edge.append(cell)
    for name, (x, y) in building.rooms.items():
        assert (round(x / step_m), round(y / step_m)) in reached, name
    assert len(building.rooms) >= 7


@EACH
def test_the_tour_leads_through_every_room_with_room_to_spare(building: Building) -> None:
    """Nowhere closer to anything than 0.3 m, from the start, and within 1.5 m of each room's point."""
    world = scene_of(Path(building.name)).below(0.35)
    way = [
        (ax + (bx - ax) * k / 50, ay + (by - ay) * k / 50)
        for (ax, ay), (bx, by) in pairwise(building.tour)
        for k in range(51)
    ]
    assert way[0] == (building.start.x_m, building.start.y_m)
    assert min(world.clearance_m(point) for point in way) > 0.3
    for name, place in building.rooms.items():
        assert min(math.dist(point, place) for point in way) < 1.5, name


def test_walls_by_name_and_by_map_file_are_the_same() -> None:
    """What a beam meets is within a cell of 2 cm, be the walls the table's or the map's; glass is a wall in both."""
    named, drawn = scene_of(Path("flat")).below(0.35), scene_of(FOLDER / "flat.yaml").below(0.35)
    bearings = np.arange(0.05, math.tau, 0.17)
    apart = [
        np.abs(named.first_hits_m(place, bearings) - drawn.first_hits_m(place, bearings))
        for place in FLAT.rooms.values()
    ]
    assert np.quantile(apart, 0.95) < 0.03  # a few pass a leg's corner


def test_a_closed_door_closes() -> None:
    """Through the bedroom's door from the hall, (2.73, 4.2) northward: 3.2 m to the wardrobe, or 0.43 m to the door."""
    north = np.array([math.pi / 2])
    for closed, distance_m in (((), 7.4 - 4.2), (("bedroom",), 4.63 - 4.2)):
        walls = scene_of(Path("flat"), closed).below(0.35)
        assert walls.first_hits_m((2.73, 4.2), north)[0] == pytest.approx(distance_m)


@pytest.mark.parametrize(
    ("named", "told"),
    [("flat", "no door 'cellar'; there are: living room, kitchen"), (None, "has doors")],
)
def test_a_door_that_there_is_not_is_refused(named: str | None, told: str) -> None:
    """The message names the doors that there are."""
    with pytest.raises(ValueError, match=told):
        scene_of(named and Path(named), ("cellar",))


def test_a_high_robot_meets_what_a_low_one_passes_under() -> None:
    """From (3.7, 1.9) southward: below the dining table's top (0.69 m up) to its far side, or to its edge at 1.75."""
    flat, south = scene_of(Path("flat")), np.array([-math.pi / 2])
    low, high = flat.below(0.35), flat.below(0.9)
    assert high.first_hits_m((3.7, 1.77), south)[0] == pytest.approx(0.02)
    assert low.first_hits_m((3.7, 1.77), south)[0] == pytest.approx(1.77 + 0.1)
