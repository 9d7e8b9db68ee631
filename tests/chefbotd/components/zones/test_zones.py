"""Zones through the socket, on a simulated robot in a room with a door: drawn, refused, undone, and driven by."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from chefbotd.client import CallError, Client, GoalUnreachable
from chefbotd.clock import run_virtual
from chefbotd.core.geometry import Pose2D
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.on_map import localized_robot

DOOR = ((1.8, 3.1), (2.9, 3.1), (2.9, 3.6), (1.8, 3.6))
"""Of the flat, between the room of the robot and the hall."""

FREE = ((3.6, 3.8), (4.0, 3.8), (4.0, 4.1))
"""Somewhere in the hall."""

ROOM, HALL = Pose2D(2.6, 1.95, -0.6), Pose2D(2.6, 4.0, 0.4)
START = Pose2D(2.45, 2.6, 2.1)
PLACES = {"table": ROOM, "sofa": HALL}
OLD = b"# by hand\nkeep_out:\n  - {name: corner, corners_m: [[8.0, 6.0], [8.4, 6.0], [8.4, 6.4]]}\n"


def on_a_robot(scenario: Callable[[SimulatedRobot, Path], Awaitable[None]], folder: Path) -> None:
    """Run a scenario on a localized robot in the flat, with two places."""

    async def main() -> None:
        async with localized_robot("flat", START, PLACES, folder=folder) as robot:
            await scenario(robot, folder / "flat.map" / "zones.yaml")

    run_virtual(main())


def content_of(file: Path) -> bytes | None:
    """What is in the file; None where there is none."""
    return file.read_bytes() if file.exists() else None


async def kind_of_refusal(asked: Awaitable[object]) -> str:
    """Why it was refused: the kind, and the sentence."""
    with pytest.raises(CallError) as refused:
        await asked
    return f"{refused.value.kind}: {refused.value}"


def test_a_zone_is_drawn_listed_switched_off_and_deleted(tmp_path: Path) -> None:
    """Each step says what the zones are now, and a stale one is refused with nothing changed."""

    async def scenario(robot: SimulatedRobot, file: Path) -> None:
        client: Client = robot.client
        assert (await client.list_zones()).zones == ()
        saved = await client.save_zone(FREE, name="rug", kind="slow", max_speed_m_s=0.1)
        assert saved.zone is not None
        assert saved.warning is None
        listed = await client.list_zones()
        assert (listed.revision, listed.zones) == (saved.revision, (saved.zone,))
        assert listed.zones[0].points_m == FREE
        off = await client.save_zone(
            FREE,
            id=saved.zone.id,
            name="rug",
            kind="slow",
            max_speed_m_s=0.1,
            enabled=False,
            revision=listed.revision,
        )
        assert off.zone is not None
        assert (off.zone.id, off.zone.enabled) == (saved.zone.id, False)
        content = content_of(file)
        stale = client.delete_zone(saved.zone.id, revision=listed.revision)
        assert (await kind_of_refusal(stale)).startswith(
            "changed_meanwhile: the zones were changed meanwhile"
        )
        assert content_of(file) == content
        unknown = await kind_of_refusal(client.delete_zone("nobody"))
        assert unknown.startswith(f"unknown_zone: no zone with the id 'nobody'; there are: {saved.zone.id}")
        await client.delete_zone(saved.zone.id, revision=off.revision)
        assert (await client.list_zones()).zones == ()

    on_a_robot(scenario, tmp_path)


def test_a_change_is_taken_back_to_the_byte(tmp_path: Path) -> None:
    """What a person wrote, with his comment, is there again; undone twice, the change is made again."""

    async def scenario(robot: SimulatedRobot, file: Path) -> None:
        await asyncio.to_thread(file.write_bytes, OLD)
        await robot.client.save_zone(FREE, name="rug")
        changed = content_of(file)
        assert (await robot.client.list_zones()).can_undo
        await robot.client.undo_zones()
        assert content_of(file) == OLD
        await robot.client.undo_zones()
        assert content_of(file) == changed

    on_a_robot(scenario, tmp_path)


def test_what_covers_the_robot_or_a_place_or_cuts_one_off_is_asked_about(tmp_path: Path) -> None:
    """The robot and the table are in one room, the sofa is behind its door; what is confirmed is drawn all the same."""

    async def scenario(robot: SimulatedRobot, file: Path) -> None:
        client, here = robot.client, ((2.3, 2.4), (2.6, 2.4), (2.6, 2.8), (2.3, 2.8))
        assert "needs_confirmation: the robot is in it" in await kind_of_refusal(client.save_zone(here))
        table = ((2.5, 1.8), (2.7, 1.8), (2.7, 2.0))
        assert "the robot could not stand at table" in await kind_of_refusal(client.save_zone(table))
        cut = await kind_of_refusal(client.save_zone(((0.0, 3.3), (9.0, 3.3)), kind="wall", name="rope"))
        assert cut == "needs_confirmation: there would be no way to sofa"
        assert content_of(file) is None
        drawn = await client.save_zone(((0.0, 3.3), (9.0, 3.3)), kind="wall", name="rope", confirmed=True)
        assert drawn.zone is not None
        plan = await client.plan_to(place="sofa")
        assert not plan.possible

    on_a_robot(scenario, tmp_path)


def test_a_zone_that_is_drawn_in_mid_drive_is_driven_round_or_ends_the_goal(tmp_path: Path) -> None:
    """A wall through the door of its way is in use within a second; no way is left, and the robot stays before it."""

    async def scenario(robot: SimulatedRobot, file: Path) -> None:
        loop = asyncio.get_running_loop()
        going = asyncio.create_task(robot.client.navigate_to(place="sofa"))
        await asyncio.sleep(1.0)
        drawn_s = loop.time()
        await robot.client.save_zone(((0.0, 3.3), (9.0, 3.3)), kind="wall", confirmed=True)
        assert loop.time() - drawn_s < 1.0
        with pytest.raises(GoalUnreachable):
            await going
        pose = robot.board.truth(robot.now_s()).world_from_base
        assert pose.y_m < 3.3 - 0.1

    on_a_robot(scenario, tmp_path)


@pytest.mark.parametrize(
    ("points", "options", "reason"),
    [
        (((0, 0), (1, 1), (1, 0), (0, 1)), {}, "out_of_range: this is no zone: its edges cross"),
        (((0, 0), (1, 1)), {}, "expected at least three corners for an area, got 2"),
        (FREE, {"kind": "slow"}, "expected max_speed_m_s for a slow zone, and for no other"),
        (FREE, {"width_m": 1.0}, "expected width_m for a wall alone"),
        (FREE, {"id": "nobody"}, "unknown_zone: no zone with the id 'nobody'; there are: none"),
    ],
)
def test_what_is_no_zone_is_refused_with_what_was_expected(
    tmp_path: Path, points: tuple[tuple[float, float], ...], options: dict[str, object], reason: str
) -> None:
    """And nothing is written."""

    async def scenario(robot: SimulatedRobot, file: Path) -> None:
        told = await kind_of_refusal(robot.client.save_zone(points, **options))  # type: ignore[arg-type]
        assert reason in told
        assert content_of(file) is None

    on_a_robot(scenario, tmp_path)
