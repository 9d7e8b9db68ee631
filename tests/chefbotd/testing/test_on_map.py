"""A robot that knows where it is: in a building, and in a room of one's own."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.on_map import localized_robot, room_of

PAGE = Path(__file__).parents[3] / "docs" / "testing.md"


@pytest.mark.slow
def test_the_documented_example_works() -> None:
    """The code of docs/testing.md as it stands there: a place in the flat, held against the truth."""
    section = PAGE.read_text().split("## A robot on a map")[1]
    (code,) = re.findall(r"```python\n(.*?)```", section.partition("\n## ")[0], re.DOTALL)
    made: dict[str, Any] = {}
    exec(compile(code, str(PAGE), "exec"), made)
    made["test_the_robot_comes_to_the_kitchen"]()


@pytest.mark.slow
def test_a_robot_in_a_room_from_a_picture_drives_there_by_its_lidar(tmp_path: Path) -> None:
    """4 by 3 m with a pillar at (2, 1.5): from one side of it to the other, within 5 cm by the truth."""
    pixels = np.full((60, 80), 255, np.uint8)
    pixels[[0, -1], :] = pixels[:, [0, -1]] = 0
    pixels[26:34, 36:44] = 0
    pixels[0:10, 0:14] = 0  # no corner is like another one
    Image.fromarray(pixels).save(tmp_path / "room.png")
    room = room_of(tmp_path / "room.png")
    assert room.percent[30, 40] == 100

    async def scenario() -> None:
        async with localized_robot(room, Pose2D(0.8, 1.2, 0.4)) as robot:
            assert "reached" in await robot.client.navigate_to(3.2, 1.8)
            true = robot.board.truth(robot.now_s())
            assert math.dist((true.world_from_base.x_m, true.world_from_base.y_m), (3.2, 1.8)) < 0.05
            assert not true.in_contact

    run_virtual(scenario())


@pytest.mark.slow
def test_in_the_office_of_equal_rooms_it_knows_the_room() -> None:
    """In room 3, where a search finds several places: within 10 cm of the truth, in the right one."""

    async def scenario() -> None:
        async with localized_robot("office", Pose2D(16.0, 2.3, 0.3)) as robot:
            pose = (await robot.client.get_state()).topics["map_pose"].data
            assert math.dist((pose.x_m, pose.y_m), (16.0, 2.3)) < 0.1

    run_virtual(scenario())


def test_a_world_that_there_is_not_is_named(tmp_path: Path) -> None:
    """With the buildings that there are; and a room says that it needs a start."""

    async def scenario() -> None:
        with pytest.raises(ValueError, match="no building 'castle'; there are: flat, office"):
            async with localized_robot("castle"):
                pytest.fail("there is no castle")
        Image.fromarray(np.zeros((9, 9), np.uint8)).save(tmp_path / "room.png")
        with pytest.raises(ValueError, match="a room needs a start"):
            async with localized_robot(room_of(tmp_path / "room.png")):
                pytest.fail("it cannot know where it stands")

    run_virtual(scenario())
