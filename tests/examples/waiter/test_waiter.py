"""The waiter on the virtual clock: each order is served once or refused, whatever is killed meanwhile."""

import asyncio
import contextlib
import itertools
import random
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import pytest

from chefbotd.client import Client
from chefbotd.clock import run_virtual
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.worker.spawn import Child
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import load
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import SimulatedRobot, running_daemon
from chefbotd.testing.on_map import localized_robot
from chefbotd.testing.transport import FakeSerialDevice
from chefbotd.testing.worker import worker_in_process
from examples.waiter.notebook import Notebook
from examples.waiter.waiter import GO_ON, MAY_I_GO_ON
from firmware_protocol.messages import BatteryLevel
from tests.chefbotd.components.maps.storage.test_store import grid
from tests.examples.waiter.guests import FakeDriving, Guests, KillableWaiter, agents_of
from tests.fakes.worker import FakeChild, Nursery

Scenario = Callable[["Shift", list[FakeDriving]], Awaitable[None]]
FULL, LOW = 4096 * 12.6 / 16.5, 4096 * 11.8 / 16.5
"""What the board's 12 bits say of 12.6 V and 11.8 V; below 12 V the battery is low."""

TABLES = {f"table {number}": Pose2D(float(number), 1.0) for number in range(1, 5)}


async def restaurant(client: Client, tables: dict[str, Pose2D], home: Pose2D) -> None:
    """Tables, and a home."""
    for name, pose in tables.items():
        await client.save_place(name, pose.x_m, pose.y_m, pose.heading_rad, kind="table")
    await client.save_place("kitchen", home.x_m, home.y_m, home.heading_rad, kind="home")


class Shift:
    """A robot whose worker only says that it drives, the waiter, and the guests."""

    def __init__(self, folder: Path, client: Client, board: ScriptedBoard | None, seed: int) -> None:
        self.client, self.board, self.chance = client, board, random.Random(seed)
        self.waiter = KillableWaiter(folder / "orders.json", self._connect)
        self.guests = Guests(lambda: self.client, self.chance)
        self.restart: Callable[[float], Awaitable[None]]

    def _connect(self) -> AbstractAsyncContextManager[Client]:
        return Client.connect(*self.client.address, name="waiter")


def shift(folder: Path, scenario: Scenario, seed: int = 1) -> None:
    """Run a scenario with the waiter at work."""
    save(MapStore(folder), "flat", grid(1))
    lidar = LidarParameters(name="top", model="ld19", device="/dev/absent")  # type: ignore[arg-type]
    settings = load().model_copy(update={"lidar": (lidar,), "maps": MapsParameters(folder=folder)})
    device = FakeSerialDevice()
    board = ScriptedBoard(device)
    drivings: list[FakeDriving] = []

    def raise_child(child: FakeChild) -> None:
        drivings.append(FakeDriving(child, 8.0))

    async def run() -> None:
        daemon = contextlib.AsyncExitStack()

        async def start() -> Client:
            spawn = Nursery(raise_child).spawn
            return await daemon.enter_async_context(running_daemon(device, settings, spawn_worker=spawn))

        async def opened(client: Client) -> None:
            board.say(BatteryLevel(FULL))
            await asyncio.sleep(1.5)
            await client.load_map("flat")

        now = Shift(folder, await start(), board, seed)
        await opened(now.client)
        await restaurant(now.client, TABLES, Pose2D(0.0, 0.0))

        async def restart(after_s: float) -> None:
            await daemon.aclose()
            await asyncio.sleep(after_s)
            now.client = await start()
            await opened(now.client)

        now.restart = restart
        async with daemon, now.waiter.working():
            await asyncio.wait_for(scenario(now, drivings), 3000.0)

    run_virtual(run())


async def begun(now: Shift) -> None:
    """The waiter has its buttons."""
    async with asyncio.timeout(10.0):
        while not (await agents_of(now.client)).buttons:  # noqa: ASYNC110 - as a person looks
            await asyncio.sleep(0.1)


def test_orders_are_served_in_turn_and_once_each(tmp_path: Path) -> None:
    """Three presses, one of a table that has ordered: two orders, each driven to once, and then it goes home."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        taking = asyncio.create_task(now.guests.take())
        now.chance.random = lambda: 1.0  # type: ignore[method-assign]  # everybody takes the food
        await asyncio.sleep(10.0)
        buttons = (await agents_of(now.client)).buttons
        assert [button.label for button in buttons] == [f"Order to table {number}" for number in range(1, 5)]
        for button in (buttons[2], buttons[0], buttons[2]):
            await now.client.press_button(button.button_id)
        await asyncio.sleep(1.0)
        await now.waiter.until_done(120.0)
        await asyncio.sleep(10.0)
        taking.cancel()
        assert [(order.table, order.state) for order in now.waiter.orders()] == [
            ("table 3", "served"),
            ("table 1", "served"),
        ]
        assert [goal.x_m for goal in drivings[0].driven] == [0.0, 3.0, 1.0, 0.0]  # home, two tables, home
        assert now.guests.taken == 2

    shift(tmp_path, scenario)


def test_food_that_nobody_takes_is_refused_with_the_reason(tmp_path: Path) -> None:
    """After a minute; then it goes on."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        (button, *_) = (await agents_of(now.client)).buttons
        await now.client.press_button(button.button_id)
        await asyncio.sleep(1.0)
        await now.waiter.until_done(120.0)
        (order,) = now.waiter.orders()
        assert (order.state, order.reason) == ("refused", "nobody took the food")

    shift(tmp_path, scenario)


def test_with_a_low_battery_it_refuses_what_waits_and_goes_home(tmp_path: Path) -> None:
    """The order on the way is served; the next one, and a later one, are refused; the last goal is home."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        taking = asyncio.create_task(now.guests.take())
        now.chance.random = lambda: 1.0  # type: ignore[method-assign]
        client = now.client
        buttons = (await agents_of(client)).buttons
        for button in buttons[:2]:
            await client.press_button(button.button_id)
        await asyncio.sleep(11.0)

        assert now.board is not None
        for _ in range(100):
            now.board.say(BatteryLevel(LOW))
            await asyncio.sleep(0.05)
        await now.waiter.until_done(120.0)
        await client.press_button(buttons[3].button_id)
        await asyncio.sleep(15.0)
        taking.cancel()
        assert [(order.table, order.state, order.reason) for order in now.waiter.orders()] == [
            ("table 1", "served", ""),
            ("table 2", "refused", "my battery is low"),
        ]
        assert drivings[0].driven[-1].x_m == 0.0

    shift(tmp_path, scenario)


async def press_stop(client: Client) -> None:
    """On the page."""
    await client.stop()


async def press_cancel(client: Client) -> None:
    """On the page."""
    await client.cancel_navigation()


async def estop_and_arm(client: Client) -> None:
    """An emergency stop, which is released after a while."""
    await client.estop()
    await asyncio.sleep(5.0)
    await client.arm()


async def go_elsewhere(client: Client) -> None:
    """Somebody sends the robot to a point, and it gets there."""
    await client.navigate_to(x_m=4.0, y_m=4.0)


@pytest.mark.parametrize("is_home", [False, True])
@pytest.mark.parametrize("stop", [press_stop, press_cancel, estop_and_arm, go_elsewhere])
def test_stopped_by_a_person_it_drives_nowhere_before_one_agrees(
    tmp_path: Path, stop: Callable[[Client], Awaitable[None]], *, is_home: bool
) -> None:
    """On its way to a table or home; nor later, when it was killed and started again meanwhile."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        (button, *_) = (await agents_of(now.client)).buttons
        if not is_home:
            await asyncio.sleep(15.0)
            await now.client.press_button(button.button_id)
        await asyncio.sleep(3.0)
        before = len(drivings[0].driven)
        await stop(now.client)
        driven = before + (stop is go_elsewhere)
        await asyncio.sleep(30.0)
        await now.waiter.kill()
        now.waiter.start()
        await begun(now)
        (button, *_) = (await agents_of(now.client)).buttons
        await now.client.press_button(button.button_id)
        await asyncio.sleep(30.0)
        assert len(drivings[0].driven) == driven
        (question,) = (await agents_of(now.client)).questions
        assert (question.question, question.choices) == (MAY_I_GO_ON, (GO_ON,))
        taking = asyncio.create_task(now.guests.take())
        now.chance.random = lambda: 1.0  # type: ignore[method-assign]
        await now.client.answer_agent(question.question_id, GO_ON)
        await now.waiter.until_done(60.0)
        taking.cancel()
        assert [order.state for order in now.waiter.orders()] == ["served"]
        assert drivings[0].driven[driven].x_m == 1.0

    shift(tmp_path, scenario)


def test_stopped_on_its_way_home_while_it_was_not_there_it_asks(tmp_path: Path) -> None:
    """An order that waits in its file sets nothing off either."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        await asyncio.sleep(2.0)
        await now.waiter.kill()
        await now.client.stop()
        await asyncio.sleep(10.0)
        Notebook(tmp_path / "orders.json").take("table 1")
        now.waiter.start()
        await begun(now)
        await asyncio.sleep(30.0)
        assert len(drivings[0].driven) == 1
        (question,) = (await agents_of(now.client)).questions
        assert question.question == MAY_I_GO_ON

    shift(tmp_path, scenario)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 21))
def test_every_order_is_served_once_or_refused_though_the_waiter_is_killed(tmp_path: Path, seed: int) -> None:
    """Ten presses at random; the waiter is killed every 20 to 60 s. No table is driven to twice for one order."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)

        async def kill() -> None:
            while True:
                await asyncio.sleep(now.chance.uniform(20.0, 60.0))
                await now.waiter.kill()
                await asyncio.sleep(now.chance.uniform(0.1, 5.0))
                now.waiter.start()

        beside = [asyncio.create_task(now.guests.take()), asyncio.create_task(kill())]
        await now.guests.order(10)
        await now.waiter.until_done(1500.0)
        for task in beside:
            task.cancel()
        orders = now.waiter.orders()
        assert len(orders) >= 3
        assert {order.state for order in orders} <= {"served", "refused"}
        assert all(order.reason for order in orders if order.state == "refused")
        assert now.guests.taken == sum(order.state == "served" for order in orders)
        assert len([goal for goal in drivings[0].driven if goal.x_m]) == len(orders)

    shift(tmp_path, scenario, seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 21))
def test_every_order_is_served_once_or_refused_though_the_daemon_ends_and_begins_again(
    tmp_path: Path, seed: int
) -> None:
    """The same with the daemon: its goals and buttons are gone, and a person loads the map. No order is served twice."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)

        async def end() -> None:
            while True:
                await asyncio.sleep(now.chance.uniform(20.0, 60.0))
                await now.restart(now.chance.uniform(0.1, 5.0))

        beside = [asyncio.create_task(now.guests.take()), asyncio.create_task(end())]
        await now.guests.order(10)
        await now.waiter.until_done(1500.0)
        for task in beside:
            task.cancel()
        await asyncio.wait(beside)
        orders = now.waiter.orders()
        assert len(drivings) > 1
        assert len(orders) >= 3
        assert {order.state for order in orders} <= {"served", "refused"}
        assert all(order.reason for order in orders if order.state == "refused")
        assert now.guests.taken == sum(order.state == "served" for order in orders)

    shift(tmp_path, scenario, seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 21))
def test_every_order_is_served_once_or_refused_whatever_of_the_three_is_killed(
    tmp_path: Path, seed: int
) -> None:
    """Ten presses at random; every 5 to 25 s the waiter, the worker or the daemon ends, by turns."""

    async def scenario(now: Shift, drivings: list[FakeDriving]) -> None:
        await begun(now)
        killed: list[str] = []

        async def kill() -> None:
            for victim in itertools.cycle(now.chance.sample(("waiter", "worker", "daemon"), 3)):
                await asyncio.sleep(now.chance.uniform(5.0, 25.0))
                killed.append(victim)
                if victim == "waiter":
                    await now.waiter.kill()
                    await asyncio.sleep(now.chance.uniform(0.1, 5.0))
                    now.waiter.start()
                elif victim == "worker":
                    drivings[-1].die()
                else:
                    await now.restart(now.chance.uniform(0.1, 5.0))

        beside = [asyncio.create_task(now.guests.take()), asyncio.create_task(kill())]
        await now.guests.order(10)
        await now.waiter.until_done(1500.0)
        for task in beside:
            task.cancel()
        await asyncio.wait(beside)
        orders = now.waiter.orders()
        assert set(killed) == {"waiter", "worker", "daemon"}
        assert len(orders) >= 3
        assert {order.state for order in orders} <= {"served", "refused"}
        assert all(order.reason for order in orders if order.state == "refused")
        assert now.guests.taken == sum(order.state == "served" for order in orders)

    shift(tmp_path, scenario, seed)


@pytest.mark.slow
def test_in_the_flat_it_serves_though_it_and_its_worker_are_killed(tmp_path: Path) -> None:
    """The real worker and the simulated lidar: two tables; the waiter is killed on the way, then the worker."""
    children: list[Child] = []
    tables = {"table 1": Pose2D(2.6, 4.0, 0.4), "table 2": Pose2D(3.0, 2.4, -0.5)}

    async def spawn(theirs: Any, parameters: Any) -> Child:
        children.append(await worker_in_process(theirs, parameters))
        return children[-1]

    async def run() -> None:
        async with localized_robot(
            "flat", Pose2D(2.45, 2.6, 2.1), folder=tmp_path, spawn_worker=spawn
        ) as robot:
            await restaurant(robot.client, tables, Pose2D(2.3, 3.0, 1.0))
            now = Shift(tmp_path, robot.client, None, 1)
            async with now.waiter.working():
                await begun(now)
                taking = asyncio.create_task(now.guests.take())
                now.chance.random = lambda: 1.0  # type: ignore[method-assign]
                for button in (await agents_of(robot.client)).buttons:
                    await robot.client.press_button(button.button_id)
                await until_driving(robot)
                await now.waiter.kill()
                await asyncio.sleep(0.5)
                now.waiter.start()
                await asyncio.sleep(1.0)
                children[-1].kill()
                await now.waiter.until_done(300.0)
                taking.cancel()
            assert [(order.table, order.state) for order in now.waiter.orders()] == [
                ("table 1", "served"),
                ("table 2", "served"),
            ]
            assert now.guests.taken == 2
            assert len(children) == 2

    run_virtual(run())


async def until_driving(robot: SimulatedRobot) -> None:
    """The robot is on its way to a table."""
    async with asyncio.timeout(60.0):
        while not await is_coming(robot):  # noqa: ASYNC110 - the truth has no event
            await asyncio.sleep(0.1)


async def is_coming(robot: SimulatedRobot) -> bool:
    """Whether the waiter says so, and the robot moves."""
    texts = [agent.text for agent in (await agents_of(robot.client)).agents]
    moves = abs(robot.board.truth(robot.now_s()).twist.linear_m_s) > 0.1
    return moves and any("table" in text for text in texts)
