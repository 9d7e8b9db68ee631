"""What waits while somebody stops the robot and arms it: in the daemon, and in programs beside it."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from functools import partial
from typing import Any

from chefbotd.client import ChefbotError, Client
from tests.scenarios.on_the_way import GOAL, START, Drive
from tests.scenarios.waiting_run import STOPS, Ask, Decide, WaitingFault

VDA5050, SPEECH = "chefbot-vda5050", "chefbot-speech"
COUNTDOWN_S, RECOGNIZED_AFTER_S = 2.0, 2.0
JUDGED_FOR_S = 1.0
"""The worker is busy for so long: past the stop and the arm, and too short for it to lose where it is."""


@contextlib.asynccontextmanager
async def goal(drive: Drive) -> AsyncIterator[Decide]:
    """A goal is accepted, and its worker has not read it yet."""
    waiting = asyncio.create_task(drive.client.navigate_to(**GOAL))

    async def decide() -> None:
        drive.begin()

    yield decide
    await _refused(waiting)


@contextlib.asynccontextmanager
async def turn(drive: Drive) -> AsyncIterator[None]:
    """The robot is to look around where it does not know where it is."""
    drive.robot.lidars["lidar"].runner.turn(1.0)
    waiting = asyncio.create_task(drive.client.localize(turn=True))
    yield
    await _refused(waiting)


async def _refused(waiting: "asyncio.Task[Any]") -> None:
    """It has ended with an error: nobody waits for a motion that will not come."""
    assert waiting.done(), "its client waits still"
    with contextlib.suppress(ChefbotError):
        assert not waiting.result(), "its client was told that it was done"


class Connection:
    """How an add-on's agent reaches the daemon, which can be cut."""

    def __init__(self, drive: Drive, name: str) -> None:
        self._address, self._name = drive.client.address, name
        self._open: list[contextlib.AsyncExitStack] = []
        self._is_there = asyncio.Event()
        self._is_there.set()

    @contextlib.asynccontextmanager
    async def connect(self) -> AsyncIterator[Client]:
        """Once there is a way to it."""
        await self._is_there.wait()
        async with contextlib.AsyncExitStack() as stack:
            client = await stack.enter_async_context(Client.connect(*self._address, name=self._name))
            self._open.append(stack)
            yield client

    async def cut(self) -> None:
        """From now on."""
        self._is_there.clear()
        await self._open.pop().aclose()

    def mend(self) -> None:
        """It is there again."""
        self._is_there.set()


@contextlib.asynccontextmanager
async def master(drive: Drive, connection: Connection) -> AsyncIterator[Any]:
    """A fleet's agent of this robot, online; yields it with what it published."""
    from chefbot_vda5050 import versions
    from chefbot_vda5050.agent import Agent
    from chefbot_vda5050.chefbot import ChefBot
    from chefbot_vda5050.factsheet import factsheet
    from chefbot_vda5050.service import limits
    from chefbot_vda5050.topics import Headers, RobotName

    from chefbotd.settings import load, packaged

    name, loop = RobotName("chefbot", "r1"), asyncio.get_running_loop()
    robot = ChefBot(connection.connect, versions.V2)

    async def publish(kind: Any, data: bytes) -> None:
        """Nobody listens."""

    agent = Agent(
        name,
        robot,
        publish,
        factsheet=partial(factsheet, None, carries_kg=2.0, seconds=1.0),
        limits=limits(load(packaged("chefbot_lidar")), 0.0),
        clock=lambda: 1_767_323_045.0 + loop.time(),
        headers=Headers(name, "2.1.0"),
    )
    working = [asyncio.create_task(work) for work in (robot.run(), agent.run())]
    agent.set_online(True)
    while not robot.facts.localized:  # noqa: ASYNC110 - as a master looks
        await asyncio.sleep(0.1)
    try:
        yield agent
    finally:
        for task in working:
            task.cancel()
        await asyncio.gather(*working, return_exceptions=True)


def send_order(agent: Any, order_id: str = "o1") -> None:
    """To where ``GOAL`` is."""
    from chefbot_vda5050.messages import Edge, Node, NodePosition, Order, encode
    from chefbot_vda5050.topics import Kind

    places = ((START.x_m, START.y_m), (GOAL["x_m"], GOAL["y_m"]))
    nodes = tuple(
        Node(
            node_id=f"n{index}",
            sequence_id=2 * index,
            released=True,
            actions=(),
            node_position=NodePosition(x=x_m, y=y_m, map_id="flat", allowed_deviation_xy=0.5),
        )
        for index, (x_m, y_m) in enumerate(places)
    )
    way = Edge(edge_id="e0", sequence_id=1, released=True, start_node_id="n0", end_node_id="n1", actions=())
    order = Order(
        header_id=1,
        timestamp="2026-01-02T03:04:05.000Z",
        version="2.1.0",
        manufacturer="chefbot",
        serial_number="r1",
        order_id=order_id,
        order_update_id=0,
        nodes=nodes,
        edges=(way,),
    )
    agent.receive(Kind.ORDER, encode(order))


async def press_go_on(drive: Drive) -> None:
    """Somebody at the robot lets the fleet's order go on."""
    (button, *_) = (await drive.client.get_state()).topics["agents"].data.buttons
    await drive.client.press_button(button.button_id)


@contextlib.asynccontextmanager
async def order_that_is_judged(drive: Drive) -> AsyncIterator[Decide]:
    """The agent asks for a way to each node, and the worker is busy."""
    async with master(drive, Connection(drive, "fleet")) as agent:
        drive.children[-1].be_busy(JUDGED_FOR_S)
        send_order(agent)

        async def decide() -> None:
            """Let it go on; an order that was refused is sent again."""
            if agent.vehicle.order_id:
                await press_go_on(drive)
            else:
                send_order(agent, "o2")

        yield decide


@contextlib.asynccontextmanager
async def order_of_who_is_cut_off(drive: Drive) -> AsyncIterator[Decide]:
    """The robot is under way for an order when its agent is cut off, and stands; the agent comes back later."""
    connection = Connection(drive, "fleet")
    async with master(drive, connection) as agent:
        send_order(agent)
        await drive.until_driving()
        await connection.cut()
        await asyncio.sleep(2.0)
        asyncio.get_running_loop().call_later(3.0, connection.mend)
        yield partial(press_go_on, drive)


class Silence:
    """A loudspeaker that says nothing."""

    def say(self, speaker: str, text: str) -> None:
        """Nothing."""

    def hush(self, *, is_hushed: bool) -> None:
        """Nothing."""


class SlowEar:
    """Recognizes one sentence, after a while."""

    async def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """All of them."""
        return candidates

    async def recognize(self, samples: Any, grammar: str) -> Any:
        """Always the same."""
        from chefbot_speech.recognition import Heard

        await asyncio.sleep(RECOGNIZED_AFTER_S)
        return Heard("go to table two", 1.0)


@contextlib.asynccontextmanager
async def sentence(drive: Drive) -> AsyncIterator[Decide]:
    """Somebody has said where to go, and the countdown is to begin when it is recognized."""
    from chefbot_speech.agent import SpeechAgent
    from chefbot_speech.talker import PageTalker, Talkers

    await drive.client.save_place("table 2", **GOAL, kind="table")
    ear: Any = SlowEar()
    speaker: Any = Silence()
    talkers = Talkers()
    agent = SpeechAgent(Connection(drive, "speech").connect, speaker, ear, talkers.end_countdowns)

    async def show(state: dict[str, Any]) -> None:
        """Nobody looks."""

    page = PageTalker(show, agent, ear.recognize, talkers, COUNTDOWN_S)
    working = asyncio.create_task(agent.run())
    await asyncio.sleep(0.5)
    await page.begin()
    await page.take({"event": "press", "rate_hz": 16_000})
    page.add_sound(bytes(32_000))
    await page.take({"event": "release"})
    try:
        yield partial(page.take, {"event": "answer", "choice": "yes"})
    finally:
        await page.leave()
        working.cancel()
        await asyncio.gather(working, return_exceptions=True)


def _faults(row: str, name: str, ask: Ask, **more: Any) -> tuple[WaitingFault, ...]:
    return tuple([WaitingFault(row, f"{name}, {what}", ask, stop, **more) for what, stop in STOPS.items()])


WAITING_FAULTS = (
    *_faults("A goal, or a turn of `localize`, that waits", "goal that waits", goal),
    *_faults("A goal, or a turn of `localize`, that waits", "turn that waits", turn),
    *_faults(
        "Add-on: an order of a fleet that is judged",
        "order that is judged",
        order_that_is_judged,
        add_on=VDA5050,
        is_busy=False,
    ),
    *_faults(
        "Add-on: an order of a fleet under way",
        "order of an agent that is cut off",
        order_of_who_is_cut_off,
        add_on=VDA5050,
        is_busy=False,
    ),
    *_faults(
        "Add-on: a sentence that is recognized",
        "sentence with a countdown",
        sentence,
        add_on=SPEECH,
        is_busy=False,
    ),
)
