"""The waiter with the real daemon, which is killed while the robot drives to a table."""

import asyncio
import os
import signal
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import pytest

from chefbotd.cli.common.exits import ProgramError
from chefbotd.cli.drive.simulated_daemon import simulated_daemon, until_worker_ready
from chefbotd.client import Client
from chefbotd.components.simulation.worlds.flat import FLAT
from examples import order
from examples.serve import MAP
from examples.waiter.notebook import Notebook
from examples.waiter.waiter import Waiter

GENEROUS_S = 200.0
START, TABLE, HOME = (2.45, 2.6, 2.1), (2.6, 4.0, 0.4), (2.3, 3.0, 1.0)


async def make_ready(robot: Client, *, first: bool) -> None:
    """What a person does: arm it after a crash, load the map, and say where it stands."""
    await until_worker_ready(robot, lambda text: None)
    if first:
        await robot.import_map(str(MAP), FLAT.name)
        await robot.save_place("table 1", *TABLE, of_map=FLAT.name, kind="table")
        await robot.save_place("kitchen", *HOME, of_map=FLAT.name, kind="home")
    else:
        await robot.arm()
    await robot.wait_until_armed()
    await robot.load_map(FLAT.name)
    await robot.set_pose(*START)
    async with robot.subscribe("localization") as events:
        async for event in events:
            if event.data.state == "localized":
                return


@pytest.mark.slow
@pytest.mark.realtime
def test_an_order_is_served_once_though_the_daemon_is_killed_on_the_way(tmp_path: Path) -> None:
    """SIGKILL while the robot drives: the next daemon is armed by a person, and the order is served once."""
    start = dict(zip(("X_M", "Y_M", "HEADING_RAD"), START, strict=True))
    environment = order.environment(tmp_path / "maps") | {
        "CHEFBOTD_SIM__PEOPLE": "[]",
        "CHEFBOTD_SIM__THINGS": "[]",
        "XDG_STATE_HOME": str(tmp_path / "state"),
        **{f"CHEFBOTD_SIM__WORLD__START_{key}": repr(value) for key, value in start.items()},
    }
    notebook, questions = Notebook(tmp_path / "orders.json"), set[str]()
    notebook.take("table 1")
    where: list[tuple[str, int]] = []

    def connect() -> AbstractAsyncContextManager[Client]:
        return Client.connect(*where[-1], name="waiter")

    async def until_killed() -> None:
        async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (address, pid):
            where.append((address.host, address.port))
            async with Client.connect(*where[-1]) as robot:
                await make_ready(robot, first=True)
                waiting = asyncio.create_task(Waiter(notebook).run(connect))
                tasks.append(waiting)
                async with robot.subscribe("navigation") as events:
                    async for event in events:
                        if event.data.state == "driving":
                            break
            os.kill(pid, signal.SIGKILL)

    async def until_served() -> None:
        async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (address, _):
            where.append((address.host, address.port))
            async with Client.connect(*where[-1]) as robot:
                await make_ready(robot, first=False)
                async with robot.subscribe("agents") as events:
                    async for event in events:
                        for question in event.data.questions:
                            questions.add(question.question)
                            await robot.answer_agent(question.question_id, question.choices[0])
                        if notebook.page.orders[0].state == "served":
                            break
            tasks[0].cancel()

    tasks: list[asyncio.Task[None]] = []

    async def scenario() -> None:
        async with asyncio.timeout(GENEROUS_S):
            with pytest.raises(ProgramError, match="exit code -9"):
                await until_killed()
            assert notebook.page.orders[0].state == "driving"
            await until_served()

    asyncio.run(scenario())
    assert [(made.table, made.state) for made in notebook.page.orders] == [("table 1", "served")]
    assert questions == {"I am at table 1. Please take your food"}
