"""Edits through the socket, on a simulated robot in a room with a door: drawn, asked about, undone, and driven by."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import numpy as np
import pytest

from chefbotd.client import CallError, GoalUnreachable
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.on_map import localized_robot

DOOR = ((0.0, 3.3), (9.0, 3.3))
"""A wall through the door of the flat, between the room of the robot and the hall."""

ROOM, HALL = Pose2D(2.6, 1.95, -0.6), Pose2D(2.6, 4.0, 0.4)
START = Pose2D(2.45, 2.6, 2.1)
PLACES = {"table": ROOM, "sofa": HALL}
FREE = ((3.6, 3.8), (4.0, 3.8), (4.0, 4.1))
"""Somewhere in the hall."""


def on_a_robot(scenario: Callable[[SimulatedRobot, Path], Awaitable[None]], folder: Path) -> None:
    """Run a scenario on a localized robot in the flat, with two places."""

    async def main() -> None:
        async with localized_robot("flat", START, PLACES, folder=folder) as robot:
            await scenario(robot, folder / "flat.map")

    run_virtual(main())


async def kind_of_refusal(asked: Awaitable[object]) -> str:
    """Why it was refused: the kind, and the sentence."""
    with pytest.raises(CallError) as refused:
        await asked
    return f"{refused.value.kind}: {refused.value}"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of the map but its edits, by its name."""
    return {
        str(path.relative_to(folder.parent)): path.read_bytes()
        for path in (*folder.rglob("*"), folder.with_suffix(".pgm"), folder.with_suffix(".yaml"))
        if path.is_file() and path.name != "edits.json"
    }


def test_an_edit_is_drawn_listed_and_taken_back_to_the_byte(tmp_path: Path) -> None:
    """Each step shows in the map; no file of the map itself is touched; a stale change is refused, and loses nothing."""

    async def scenario(robot: SimulatedRobot, own: Path) -> None:
        client = robot.client
        before, files = await client.get_map(), contents(own)
        assert (await client.list_map_edits()).edits == ()
        erased = await client.edit_map("erase", FREE, to="unknown")
        assert erased.edit is not None
        assert erased.warning is None
        unknown = (await client.get_map()).grid().percent == -1
        assert unknown.sum() - (before.grid().percent == -1).sum() == 150  # 0.06 m2 in cells of 2 cm
        wall = await client.edit_map("wall", ((3.6, 4.5), (3.9, 4.5)), revision=erased.revision)
        assert wall.edit is not None
        listed = await client.list_map_edits()
        assert (listed.revision, listed.edits) == (wall.revision, (erased.edit, wall.edit))
        stale = await kind_of_refusal(client.delete_map_edit(wall.edit.id, revision=erased.revision))
        assert stale.startswith("changed_meanwhile: the edits were changed meanwhile")
        unknown_id = await kind_of_refusal(client.delete_map_edit("nobody"))
        assert unknown_id.startswith("unknown_edit: no edit with the id 'nobody'; there are: ")
        assert (await client.list_map_edits()) == listed
        await client.delete_map_edit(erased.edit.id)
        assert (await client.list_map_edits()).edits == (wall.edit,)
        await client.undo_map_edit()
        await client.undo_map_edit()
        await client.undo_map_edit()
        assert await client.get_map() == before
        assert (await kind_of_refusal(client.undo_map_edit())).startswith("nothing_to_undo: ")
        await client.redo_map_edit()
        assert (await client.list_map_edits()).edits == (erased.edit,)
        assert contents(own) == files

    on_a_robot(scenario, tmp_path)


def test_the_view_is_turned_and_nothing_else(tmp_path: Path) -> None:
    """The map, its places and its frame are as they were; the angle is kept, and can be taken back."""

    async def scenario(robot: SimulatedRobot, own: Path) -> None:
        client = robot.client
        before, places = await client.get_map(), await client.list_places()
        await client.turn_map_view(0.12)
        assert (await client.list_map_edits()).view_angle_rad == 0.12
        assert (await client.get_map(), await client.list_places()) == (before, places)
        await client.undo_map_edit()
        assert (await client.list_map_edits()).view_angle_rad == 0.0

    on_a_robot(scenario, tmp_path)


def test_what_leaves_the_robot_or_a_place_no_way_is_asked_about(tmp_path: Path) -> None:
    """A wall over the robot, one through its door, a crop without it; what is confirmed is drawn all the same."""

    async def scenario(robot: SimulatedRobot, own: Path) -> None:
        client = robot.client
        over = await kind_of_refusal(client.edit_map("wall", ((2.3, 2.6), (2.6, 2.6))))
        assert over.startswith("needs_confirmation: the robot could not drive from where it is")
        cut = await kind_of_refusal(client.edit_map("wall", DOOR))
        assert cut == "needs_confirmation: there would be no way to sofa"
        hall = ((0.0, 3.5), (9.0, 3.5), (9.0, 7.0), (0.0, 7.0))
        cropped = await kind_of_refusal(client.edit_map("crop", hall))
        assert "the robot could not drive from where it is" in cropped
        assert "the robot could not stand at table" in cropped
        assert not (own / "edits.json").exists()
        assert (await client.plan_to(place="sofa")).possible
        await client.edit_map("wall", DOOR, confirmed=True)
        assert not (await client.plan_to(place="sofa")).possible
        await client.undo_map_edit()
        assert (await client.plan_to(place="sofa")).possible

    on_a_robot(scenario, tmp_path)


def test_a_wall_that_is_drawn_in_mid_drive_is_in_use_within_a_second(tmp_path: Path) -> None:
    """No way is left, and the robot stays before it; it knows where it is all the while."""

    async def scenario(robot: SimulatedRobot, own: Path) -> None:
        loop, client = asyncio.get_running_loop(), robot.client
        going = asyncio.create_task(client.navigate_to(place="sofa"))
        await asyncio.sleep(1.0)
        drawn_s = loop.time()
        await client.edit_map("wall", DOOR, confirmed=True)
        assert loop.time() - drawn_s < 1.0
        with pytest.raises(GoalUnreachable):
            await going
        assert robot.board.truth(robot.now_s()).world_from_base.y_m < 3.3 - 0.1
        await client.undo_map_edit()
        await client.navigate_to(place="sofa")
        truth = robot.board.truth(robot.now_s()).world_from_base
        assert np.hypot(truth.x_m - HALL.x_m, truth.y_m - HALL.y_m) < 0.15

    on_a_robot(scenario, tmp_path)


@pytest.mark.parametrize(
    ("kind", "points", "options", "reason"),
    [
        ("erase", ((0, 0), (1, 1), (1, 0), (0, 1)), {}, "out_of_range: this is no area: its edges cross"),
        ("crop", ((0, 0), (1, 1)), {}, "expected at least three corners for an area, got 2"),
        ("crop", FREE, {"to": "free"}, "expected to for what is erased alone"),
        ("erase", FREE, {"width_m": 1.0}, "expected width_m for a wall alone"),
    ],
)
def test_what_is_no_edit_is_refused_with_what_was_expected(
    tmp_path: Path,
    kind: str,
    points: tuple[tuple[float, float], ...],
    options: dict[str, object],
    reason: str,
) -> None:
    """And nothing is written."""

    async def scenario(robot: SimulatedRobot, own: Path) -> None:
        told = await kind_of_refusal(robot.client.edit_map(kind, points, **options))  # type: ignore[arg-type]
        assert reason in told
        assert not (own / "edits.json").exists()

    on_a_robot(scenario, tmp_path)
