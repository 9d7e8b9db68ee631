"""The whole robot on the virtual clock: simulated ChefBot, daemon, worker, agent, and a master in memory."""

import asyncio
import contextlib
import itertools
import math
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from chefbot_vda5050 import versions
from chefbot_vda5050.chefbot import ChefBot
from chefbot_vda5050.messages import EStop, Node, NodePosition, OperatingMode, Order, State
from chefbot_vda5050.robot import Performed, perform
from chefbot_vda5050.service import limits
from chefbot_vda5050.vehicle import Facts
from msgspec.structs import replace
from vda5050_daemon import FakeDaemon
from vda5050_fakes import Fleet, is_idle
from vda5050_orders import HEADER, action, edge

from chefbotd.client import CallError, Client, ConnectionLost
from chefbotd.clock import run_virtual
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.on_map import localized_robot

START = (FLAT.start.x_m, FLAT.start.y_m)
MIDDLE, END = (1.9, 2.55), (1.4, 2.55)
"""Free places of the living room: 0.6 and 1.1 m from the start."""

Scenario = Callable[["RealFleet", SimulatedRobot], Awaitable[None]]


class RealFleet(Fleet):
    """The same view of a master, with a real robot behind the agent."""

    def __init__(self, robot: ChefBot, **options: Any) -> None:
        super().__init__(robot, **options)  # type: ignore[arg-type]


def order_from(start: tuple[float, float], *others: tuple[float, float], **actions: Any) -> Order:
    """An order along these points of the flat; ``n1`` and so on have these actions."""
    points = (start, *others)
    return Order(
        **HEADER,
        order_id="o1",
        order_update_id=0,
        nodes=tuple(
            Node(
                node_id=f"n{index}",
                sequence_id=2 * index,
                released=True,
                actions=actions.get(f"n{index}", ()),
                node_position=NodePosition(x=x, y=y, map_id="flat"),
            )
            for index, (x, y) in enumerate(points)
        ),
        edges=tuple(edge(index) for index in range(len(others))),
    )


def in_flat(scenario: Scenario, folder: Path) -> None:
    """Run a scenario with the robot localized in the flat, and its agent at work."""

    async def run() -> None:
        async with localized_robot(folder=folder) as simulated:
            connect = partial(Client.connect, *simulated.client.address, name="fleet")
            robot = ChefBot(connect, versions.of(HEADER["version"]))
            own = limits(load(packaged("chefbot_lidar")), 10.0)
            now = RealFleet(robot, limits=own)
            tasks = [asyncio.create_task(work) for work in (robot.run(), now.agent.run())]
            now.agent.set_online(True)
            try:
                await now.until(lambda state: state.agv_position is not None)
                await scenario(now, simulated)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        assert now.problems == []

    run_virtual(run())


async def answering(client: Client, choice: str) -> None:
    """A person who answers the next question."""
    async with client.subscribe("agents") as events:
        async for event in events:
            if event.data.questions:
                await client.answer_agent(event.data.questions[0].question_id, choice)
                return


@pytest.mark.slow
@pytest.mark.usefixtures("version")
def test_an_order_with_a_pick_is_driven_and_done(tmp_path: Path) -> None:
    """1.5 m in the flat over a node without a stop; the true pose is within 10 cm, and a person has loaded it.

    In version 3.0 the robot tells its path: it ends at the node that is driven to, within 10 cm.
    """

    async def scenario(now: RealFleet, simulated: SimulatedRobot) -> None:
        person = asyncio.create_task(answering(simulated.client, "Loaded"))
        pick = action("pick", "p", loadType="soup")
        await now.order(order_from(START, MIDDLE, END, n2=(pick,)))
        state = await now.until(lambda state: state.last_node_id == "n2" and is_idle(state), within_s=120.0)
        await person
        assert [load.load_type for load in state.loads or ()] == ["soup"]
        assert state.errors == ()
        true = simulated.board.truth(simulated.now_s()).world_from_base
        assert (true.x_m, true.y_m) == pytest.approx(END, abs=0.1)
        assert any(state.last_node_id == "n1" and state.driving for state in now.states())
        paths = [state.planned_path for state in now.states() if state.planned_path is not None]
        assert bool(paths) is (HEADER["version"] == "3.0.0")
        ends = [path["trajectory"]["controlPoints"][-1] for path in paths]
        assert all(min(math.dist((end["x"], end["y"]), node) for node in (MIDDLE, END)) < 0.1 for end in ends)

    in_flat(scenario, tmp_path)


@pytest.mark.slow
def test_a_wall_is_no_node_and_an_order_on_its_way_can_be_cancelled(tmp_path: Path) -> None:
    """A node in a wall is refused by the robot's own planner; cancelled, the robot stands within 3 s."""

    async def scenario(now: RealFleet, simulated: SimulatedRobot) -> None:
        await now.order(order_from(START, (-50.0, -50.0)))
        state = await now.until(lambda state: bool(state.errors))
        assert error_types(state) == ["noRouteError"]
        await now.order(order_from(START, END), order_id="o2")
        await now.until(lambda state: state.driving)
        await now.act("cancelOrder", "c")
        began_s = now.now_s()
        await now.until(lambda state: [one.action_status for one in state.action_states] == ["FINISHED"])
        assert now.now_s() - began_s < 3.0
        here = simulated.board.truth(simulated.now_s()).world_from_base
        await asyncio.sleep(5.0)
        there = simulated.board.truth(simulated.now_s()).world_from_base
        assert (there.x_m, there.y_m) == pytest.approx((here.x_m, here.y_m), abs=0.005)

    in_flat(scenario, tmp_path)


@pytest.mark.slow
def test_a_stop_at_the_robot_pauses_the_order_until_somebody_lets_it_go_on(tmp_path: Path) -> None:
    """Emergency stop: FATAL with a hint; armed again it is the button on the page that has it go on."""

    async def scenario(now: RealFleet, simulated: SimulatedRobot) -> None:
        await now.order(order_from(START, END))
        await now.until(lambda state: state.driving)
        await simulated.client.estop("a person")
        state = await now.until(lambda state: state.safety_state.e_stop is EStop.MANUAL)
        assert "emergencyStop" in error_types(state)
        await arming_alone_moves_nothing(now, simulated)

    in_flat(scenario, tmp_path)


@pytest.mark.slow
def test_an_order_that_came_to_a_robot_that_was_stopped_waits_for_a_person_too(tmp_path: Path) -> None:
    """Its goal is refused; armed again the robot stands until the button is pressed."""

    async def scenario(now: RealFleet, simulated: SimulatedRobot) -> None:
        await simulated.client.estop("a person")
        await now.until(lambda state: "emergencyStop" in error_types(state))
        await now.order(order_from(START, END))
        await now.until(lambda state: "driveError" in error_types(state))
        await arming_alone_moves_nothing(now, simulated)

    in_flat(scenario, tmp_path)


async def arming_alone_moves_nothing(now: RealFleet, simulated: SimulatedRobot) -> None:
    """Armed, the robot stands for 10 s with its order paused; the button on the page has it drive to ``n1``."""
    await now.until(lambda state: not state.driving)
    await simulated.client.arm()
    here = simulated.board.truth(simulated.now_s()).world_from_base
    await asyncio.sleep(10.0)
    there = simulated.board.truth(simulated.now_s()).world_from_base
    assert (there.x_m, there.y_m) == pytest.approx((here.x_m, here.y_m), abs=0.005)
    assert now.states()[-1].paused
    buttons = (await simulated.client.get_state()).topics["agents"].data.buttons
    await simulated.client.press_button(buttons[0].button_id)
    await now.until(lambda state: state.last_node_id == "n1" and is_idle(state), within_s=60.0)


def error_types(state: State) -> list[str]:
    """Of a state's errors."""
    return [one.error_type for one in state.errors]


def test_a_question_is_asked_again_when_the_daemon_was_away() -> None:
    """Nobody's load is given up for it; a daemon that refuses to ask fails the action."""
    performed: list[Performed] = []

    async def run() -> None:
        daemon = FakeDaemon()
        robot = ChefBot(daemon.connect)
        daemon.answers = [ConnectionLost("killed"), "Loaded", CallError(-1, "too_many", "too many questions")]
        asking = asyncio.create_task(perform(robot, action()))
        await asyncio.sleep(5.0)
        assert not daemon.calls
        running = [asyncio.create_task(work) for work in (daemon.run(), robot.run())]
        performed.extend([await asking, await perform(robot, action())])
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        assert daemon.calls == ["ask Please load the load on me."] * 3

    run_virtual(run())
    assert [(one.failed, one.result) for one in performed] == [("", "Loaded"), ("too many questions", None)]


def test_a_question_stays_the_same_until_somebody_answers() -> None:
    """For a minute there is one question with one number on the page; then it is answered, and is gone."""
    shown: list[list[int]] = []
    performed: list[Performed] = []

    async def watch(client: Client) -> None:
        async with client.subscribe("agents", policy="ordered") as events:
            async for event in events:
                shown[:] = [*shown, [question.question_id for question in event.data.questions]]

    async def run() -> None:
        async with simulated_robot(load(packaged("chefbot_lidar"))) as simulated:
            robot = ChefBot(partial(Client.connect, *simulated.client.address, name="fleet"))
            running = [asyncio.create_task(work) for work in (robot.run(), watch(simulated.client))]
            asking = asyncio.create_task(perform(robot, action()))
            await asyncio.sleep(60.0)
            await simulated.client.answer_agent(shown[-1][0], "Loaded")
            performed.append(await asking)
            await asyncio.sleep(1.0)
            for task in running:
                task.cancel()
            await asyncio.gather(*running, return_exceptions=True)

    run_virtual(run())
    numbers = [one for one, _ in itertools.groupby(shown)]
    assert [len(each) for each in numbers] == [0, 1, 0]
    assert performed[0].result == "Loaded"


def test_without_its_daemon_the_robot_says_so_and_connects_again() -> None:
    """Nobody listens on the port; then somebody does."""
    found: list[Facts] = []

    async def run() -> None:
        ports = [1]

        @contextlib.asynccontextmanager
        async def connect() -> Any:
            async with Client.connect("127.0.0.1", ports[-1]) as client:
                yield client

        robot = ChefBot(connect)
        robot.listen(lambda: found.append(robot.facts), lambda: None)
        task = asyncio.create_task(robot.run())
        async with asyncio.timeout(100.0):
            while not any("127.0.0.1" in facts.missing for facts in found):  # noqa: ASYNC110 - as a person looks
                await asyncio.sleep(0.1)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run_virtual(run())
    assert not found[-1].connected
    assert replace(found[-1], missing="") == Facts()
    assert found[-1].mode is OperatingMode.AUTOMATIC
