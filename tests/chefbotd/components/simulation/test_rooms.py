"""The default room, and maps in map_server's format."""

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chefbotd.components.maps.algorithms.map_server import MapFileError
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.world import World


def write_map(folder: Path, rows: list[list[int]], yaml: str, name: str = "room.pgm") -> Path:
    """A map of these grey values (first row on top) with this YAML; returns the YAML's path."""
    Image.fromarray(np.array(rows, dtype=np.uint8)).save(folder / name)
    path = folder / "room.yaml"
    path.write_text(yaml)
    return path


def furnished_room() -> World:
    """Its walls at any height."""
    return scene_of(None).below(1.0)


def walls_of(path: Path) -> World:
    """The walls of the map with this YAML."""
    return scene_of(path).below(1.0)


def test_the_square_drive_has_room() -> None:
    """Every point of the square from (0, 0) to (2, 2) is at least 0.6 m from every wall."""
    room = furnished_room()
    sides = [(0, 0, 1, 0), (2, 0, 0, 1), (2, 2, -1, 0), (0, 2, 0, -1)]
    points = [(x + s * dx / 50, y + s * dy / 50) for x, y, dx, dy in sides for s in range(101)]
    assert min(room.clearance_m(point) for point in points) >= 0.6


def test_the_square_drive_never_loses_the_echo() -> None:
    """Along each side, what lies ahead is within the sensor's 4 m."""
    room = furnished_room()
    for x, y, heading in [(0, 0, 0), (2, 0, math.pi / 2), (2, 2, math.pi), (0, 2, -math.pi / 2)]:
        assert room.first_hits_m((x, y), np.array([heading]))[0] < 4.0


def test_the_first_row_is_the_top_and_the_origin_the_lower_left(tmp_path: Path) -> None:
    """One black pixel, upper left of 2 x 3 at 0.5 m, origin (-1, 2), covers x -1 to -0.5 and y 2.5 to 3."""
    yaml = "image: room.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
    world = walls_of(write_map(tmp_path, [[0, 254, 254], [254, 254, 254]], yaml))
    ahead, up = (
        world.first_hits_m((-2.0, 2.75), np.array([0.0]))[0],
        world.first_hits_m((-0.75, 0.0), np.array([math.pi / 2]))[0],
    )
    assert (ahead, up) == pytest.approx((1.0, 2.5))
    assert world.clearance_m((0.0, 2.75)) == pytest.approx(0.5)


def test_inner_edges_of_a_wall_are_no_walls(tmp_path: Path) -> None:
    """Three pixels in a row are one 3 x 1 box: from its middle, its ends are 1.5 m away."""
    yaml = "image: room.pgm\nresolution: 1.0\norigin: [0, 0, 0]\n"
    world = walls_of(write_map(tmp_path, [[0, 0, 0]], yaml))
    assert world.first_hits_m((1.5, 0.5), np.array([0.0, math.pi / 2])) == pytest.approx([1.5, 0.5])


def test_the_origins_yaw_turns_the_map(tmp_path: Path) -> None:
    """A pixel from (0, 0) to (1, 1), turned left by 90 degrees, lies at x -1 to 0 and y 0 to 1."""
    yaml = f"image: 'room.pgm'\nresolution: 1.0\norigin: [0, 0, {math.pi / 2}]  # turned\n---\n"
    world = walls_of(write_map(tmp_path, [[0]], yaml))
    assert world.first_hits_m((-2.0, 0.5), np.array([0.0]))[0] == pytest.approx(1.0)


def test_negate_swaps_black_and_white(tmp_path: Path) -> None:
    """With ``negate: 1`` white is occupied; PNG is read as well as PGM."""
    yaml = "image: room.png\nresolution: 1.0\norigin: [0, 0, 0]\nnegate: 1\nmode: trinary\nfree_thresh: .2\n"
    world = walls_of(write_map(tmp_path, [[0, 255]], yaml, "room.png"))
    assert world.first_hits_m((0.0, 0.5), np.array([0.0]))[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("yaml", "error", "named"),
    [
        ("image: room.pgm\nresolution: -1\norigin: [0, 0, 0]\n", MapFileError, "resolution"),
        ("image: room.pgm\nresolution: 1\n", MapFileError, "origin"),
        ("image: none.pgm\nresolution: 1\norigin: [0, 0, 0]\n", OSError, "none.pgm"),
        ("image: room.pgm\nresolution: 1\norigin: [0, 0, 0]\n", ValueError, "occupied_thresh 0.65"),
    ],
)
def test_what_is_no_map_is_refused(tmp_path: Path, yaml: str, error: type[Exception], named: str) -> None:
    """A bad or missing key, a missing image and a map without walls are errors that name it."""
    with pytest.raises(error, match=named):
        walls_of(write_map(tmp_path, [[254, 254]], yaml))
