"""Ways to nodes that are known need no plan before an order is taken."""

import asyncio
import contextlib

import pytest
from chefbot_vda5050.chefbot import ChefBot
from chefbot_vda5050.known_ways import KNOWN_FOR_S, MOST, KnownWays
from chefbot_vda5050.messages import NodePosition
from chefbot_vda5050.robot import DriveFailed
from vda5050_daemon import FakeDaemon

from chefbotd.clock import run_virtual

HERE = NodePosition(x=1.0, y=2.0, map_id="flat")


def test_a_way_is_known_for_ten_minutes() -> None:
    """Found at 5 s, it is known until 605 s; found again, for as long again."""
    ways = KnownWays()
    assert not ways.has(HERE, 5.0)
    ways.add(HERE, 5.0)
    assert (ways.has(HERE, 5.0 + KNOWN_FOR_S), ways.has(HERE, 5.1 + KNOWN_FOR_S)) == (True, False)
    ways.add(HERE, 100.0)
    assert ways.has(HERE, 100.0 + KNOWN_FOR_S)


@pytest.mark.parametrize(
    "other",
    [
        NodePosition(x=1.0, y=2.0, map_id="roof"),
        NodePosition(x=1.1, y=2.0, map_id="flat"),
        NodePosition(x=1.0, y=2.1, map_id="flat"),
        NodePosition(x=1.0, y=2.0, map_id="flat", theta=0.0),
        NodePosition(x=1.0, y=2.0, map_id="flat", allowed_deviation_xy=0.1),
    ],
)
def test_another_node_is_another_way(other: NodePosition) -> None:
    """Also the same place with another heading: a long robot may not fit."""
    ways = KnownWays()
    ways.add(HERE, 0.0)
    assert not ways.has(other, 1.0)


def test_of_too_many_the_oldest_is_forgotten() -> None:
    """One that was found again is not the oldest."""
    ways = KnownWays()
    nodes = [NodePosition(x=float(index), y=0.0, map_id="flat") for index in range(MOST + 1)]
    for index, node in enumerate(nodes[:-1]):
        ways.add(node, float(index))
    ways.add(nodes[0], 0.0)
    ways.add(nodes[-1], 0.0)
    assert [ways.has(node, 0.0) for node in (nodes[0], nodes[1], nodes[-1])] == [True, False, True]


def test_the_robot_plans_once_and_anew_when_a_drive_has_failed_or_the_daemon_was_away() -> None:
    """What may have changed is looked at again; a node without a way is looked at each time.

    One is refused where the map has no way, and not where somebody stands in it.
    """

    async def run() -> None:
        daemon = FakeDaemon()
        robot = ChefBot(daemon.connect)
        tasks = [asyncio.create_task(work) for work in (daemon.run(), robot.run())]
        while not robot.facts.connected:  # noqa: ASYNC110 - as a person looks
            await asyncio.sleep(0.1)

        async def plans(expected: int) -> None:
            assert await robot.unreachable(HERE) == ""
            assert daemon.planned == expected

        await plans(1)
        await plans(1)
        daemon.ends.append("unreachable")
        with pytest.raises(DriveFailed):
            await robot.drive_to(HERE)
        await plans(2)
        daemon.closed = "a wall"
        other = NodePosition(x=9.0, y=9.0, map_id="flat")
        assert [await robot.unreachable(other) for _ in range(2)] == ["a wall", "a wall"]
        assert daemon.planned == 4
        daemon.closed = "a passer-by"
        assert [await robot.unreachable(other) for _ in range(2)] == ["", ""]
        assert daemon.planned == 6
        for task in tasks:
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.gather(*tasks)

    run_virtual(run())
