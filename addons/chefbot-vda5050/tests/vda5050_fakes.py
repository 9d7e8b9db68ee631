"""A robot that drives as the crow flies, and a broker in memory that checks every message against its schema."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from typing import Any

import msgspec
from chefbot_vda5050 import schemas
from chefbot_vda5050.agent import Agent
from chefbot_vda5050.factsheet import factsheet
from chefbot_vda5050.messages import (
    Action,
    InstantActions,
    Message,
    NodePosition,
    Order,
    State,
    decode,
    encode,
)
from chefbot_vda5050.problems import ROWS
from chefbot_vda5050.robot import CannotDo, DriveFailed
from chefbot_vda5050.topics import Headers, Kind, RobotName, timestamp_of
from chefbot_vda5050.vehicle import Facts, Limits
from msgspec.structs import replace
from vda5050_orders import AT_START, HEADER, LIMITS, action

NAME = RobotName("chefbot", "r1")
STEP_S = 0.1
EPOCH_S = 1_767_323_045.0
"""The time of day when a test's clock is at 0."""


class FakeRobot:
    """Drives straight at ``speed_m_s``. ``answers`` are what people say; ``driven`` is where it came to, in turn."""

    def __init__(self, speed_m_s: float = 1.0) -> None:
        self.speed_m_s = speed_m_s
        self.facts = AT_START
        self.driven: list[tuple[float, float]] = []
        self.asked: list[str] = []
        self.said: list[str] = []
        self.answers: asyncio.Queue[str | None] = asyncio.Queue()
        self.fails: list[DriveFailed] = []
        self.closed: set[tuple[float, float]] = set()
        self.planning_s = 0.0
        self._planner = asyncio.Lock()
        self._goal = 0
        self.changed: Callable[[], None] = lambda: None
        self.go_on: Callable[[], None] = lambda: None

    def listen(self, changed: Callable[[], None], go_on: Callable[[], None]) -> None:
        """As the interface has it."""
        self.changed, self.go_on = changed, go_on

    def set(self, **changes: Any) -> None:
        """Change the facts."""
        self.facts = replace(self.facts, **changes)
        self.changed()

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """In steps, until it is there or another goal comes."""
        speed_m_s = min(self.speed_m_s, max_speed_m_s or self.speed_m_s)
        self._goal += 1
        goal = self._goal
        if self.fails:
            raise self.fails.pop(0)
        while (left_m := self.facts.distance_m(position)) > 1e-9:
            self.set(linear_m_s=speed_m_s)
            await asyncio.sleep(STEP_S)
            if goal != self._goal:
                raise DriveFailed("replaced", by_people=True)
            share = min(1.0, speed_m_s * STEP_S / left_m)
            x_m = self.facts.x_m + share * (position.x - self.facts.x_m)
            y_m = self.facts.y_m + share * (position.y - self.facts.y_m)
            self.set(x_m=x_m, y_m=y_m)
        self.set(
            linear_m_s=0.0, heading_rad=self.facts.heading_rad if position.theta is None else position.theta
        )
        self.driven.append((position.x, position.y))

    async def stop(self) -> None:
        """Stands after a step."""
        self._goal += 1
        await asyncio.sleep(STEP_S)
        self.set(linear_m_s=0.0)

    async def resume(self) -> None:
        """Goes on."""
        self.set(paused=False)

    async def unreachable(self, position: NodePosition) -> str:
        """Where it is closed; the planner takes its time."""
        async with self._planner:
            await asyncio.sleep(self.planning_s)
        return "a wall is in the way" if (position.x, position.y) in self.closed else ""

    async def set_pose(self, position: NodePosition) -> None:
        """On its map only."""
        if position.map_id != self.facts.map_id:
            raise CannotDo("another map")
        self.set(x_m=position.x, y_m=position.y, heading_rad=position.theta, localized=True)

    async def say(self, text: str) -> None:
        """Remember it."""
        self.said.append(text)

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> str | None:
        """The next answer."""
        self.asked.append(question)
        answer = await self.answers.get()
        assert answer is None or answer in choices
        return answer


class Fleet:
    """An agent with its robot, and a master's view of them: ``sent`` is all that was published."""

    def __init__(self, robot: FakeRobot | None = None, limits: Limits = LIMITS, **options: Any) -> None:
        self.robot = robot or FakeRobot()
        self.sent: list[tuple[Kind, bytes]] = []
        self.problems: list[str] = []
        self._new = asyncio.Event()
        self._headers = 0
        self.agent = Agent(
            NAME,
            self.robot,
            self._publish,
            factsheet=partial(factsheet, None, carries_kg=2.0, seconds=1.0),
            limits=limits,
            clock=self.now_s,
            headers=Headers(NAME, HEADER["version"]),
            **options,
        )

    def now_s(self) -> float:
        """The time of day on the loop's clock."""
        return EPOCH_S + asyncio.get_running_loop().time()

    async def _publish(self, kind: Kind, data: bytes) -> None:
        self.sent.append((kind, data))
        self.problems += [f"{kind}: {problem}" for problem in strict_problems(kind, data)]
        self._new.set()

    def states(self) -> list[State]:
        """All states that were reported."""
        return [decode(data, State) for kind, data in self.sent if kind is Kind.STATE]

    async def send(self, kind: Kind, message: Message, **changes: Any) -> None:
        """Publish a message now, with a header of its own."""
        header = {"header_id": self._headers, "timestamp": timestamp_of(self.now_s())} | changes
        self._headers += 1
        message = replace(message, **header)
        assert strict_problems(kind, encode(message)) == []
        self.agent.receive(kind, encode(message))

    async def order(self, order: Order, **changes: Any) -> None:
        """Send an order."""
        await self.send(Kind.ORDER, order, **changes)

    async def act(self, kind: str, number: str, **parameters: Any) -> None:
        """Send an instant action."""
        await self.instant(action(kind, number, "NONE", **parameters))

    async def instant(self, *actions: Action) -> None:
        """Send instant actions in one message."""
        await self.send(Kind.INSTANT_ACTIONS, InstantActions(**HEADER, actions=actions))

    async def until(self, condition: Callable[[State], bool], within_s: float = 100.0) -> State:
        """The first state that fulfils this, of those that come and the latest one."""
        async with asyncio.timeout(within_s):
            while True:
                self._new.clear()
                states = self.states()
                if states and condition(states[-1]):
                    return states[-1]
                await self._new.wait()


@contextlib.asynccontextmanager
async def fleet(
    robot: FakeRobot | None = None, limits: Limits = LIMITS, **options: Any
) -> AsyncIterator[Fleet]:
    """An agent at work; at the end every message that it published has to fit its schema."""
    now = Fleet(robot, limits, **options)
    task = asyncio.create_task(now.agent.run())
    now.agent.set_online(True)
    try:
        await now.until(lambda state: True)
        yield now
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
    assert not now.problems, now.problems


def strict_problems(kind: Kind, data: bytes) -> list[str]:
    """What breaks the schema of the message's version, and fields that this version does not know."""
    content = json.loads(data)
    schema = schemas.schema(kind, content["version"])
    return schemas.problems(kind, data) + [f"unknown: {name}" for name in _unknown(content, schema, schema)]


def _unknown(content: Any, schema: dict[str, Any], whole: dict[str, Any]) -> Iterator[str]:
    while "$ref" in schema:
        found: Any = whole
        for step in schema["$ref"].removeprefix("#/").split("/"):
            found = found[step]
        schema = found
    if isinstance(content, list):
        for one in content:
            yield from _unknown(one, schema.get("items", {}), whole)
    elif isinstance(content, dict) and "properties" in schema:
        for name, one in content.items():
            if name in schema["properties"]:
                yield from _unknown(one, schema["properties"][name], whole)
            else:
                yield name


def error_types(state: State) -> list[str]:
    """Of a state's errors, by their names in 2.1."""
    of_2_1 = {row.type_3_0: row.type_2_1 for row in ROWS.values()}
    return [of_2_1.get(one.error_type, one.error_type) for one in state.errors]


def status(state: State, number: str) -> str:
    """The status of an action; empty: it is not there."""
    found = (one.action_status for one in state.all_action_states if one.action_id == number)
    return str(next(found, ""))


def is_idle(state: State) -> bool:
    """Nothing is left of the order."""
    ended = all(one.action_status in ("FINISHED", "FAILED") for one in state.all_action_states)
    return not state.node_states and ended and not state.driving


def builtins(message: Message) -> dict[str, Any]:
    """A message as JSON has it."""
    content: dict[str, Any] = msgspec.json.decode(encode(message))
    return content


def unconnected(**changes: Any) -> Facts:
    """Facts of a robot whose daemon is gone."""
    return replace(Facts(missing="gone"), **changes)
