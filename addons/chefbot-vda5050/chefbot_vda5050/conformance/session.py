"""One robot as a master sees it over MQTT: what it has published, and messages to it."""

import asyncio
import contextlib
import time
import uuid
from collections.abc import AsyncIterator, Callable
from typing import Any

import aiomqtt
from msgspec import Struct
from msgspec.structs import replace

from chefbot_vda5050 import versions
from chefbot_vda5050.broker import NO_DELAY, BrokerParameters
from chefbot_vda5050.messages import (
    ENDED,
    Action,
    ActionParameter,
    ActionStatus,
    BlockingType,
    Connection,
    Error,
    Factsheet,
    Header,
    InstantActions,
    MalformedMessage,
    Message,
    Order,
    State,
    Visualization,
    decode,
    encode,
)
from chefbot_vda5050.problems import Reason, names
from chefbot_vda5050.topics import Headers, Kind, RobotName

KINDS: dict[Kind, type[Header]] = {
    Kind.STATE: State,
    Kind.CONNECTION: Connection,
    Kind.FACTSHEET: Factsheet,
    Kind.VISUALIZATION: Visualization,
}


class Failed(Exception):
    """The robot does otherwise than the standard says; the text says what it did."""


class NotTried(Exception):
    """The case could not be tried; the text says why."""


class Seen(Struct, frozen=True):
    """A message of the robot; ``message`` is None where it could not be read."""

    kind: Kind
    data: bytes
    retained: bool
    qos: int
    arrival_s: float
    message: Header | None


class Session:
    """``seen`` is all that the robot has published since we listen. ``patience_s`` is how long an answer may take."""

    def __init__(self, client: aiomqtt.Client, name: RobotName, patience_s: float, version: str) -> None:
        self.name, self.patience_s, self.version = name, patience_s, version
        self.seen: list[Seen] = []
        self._client, self._headers = client, Headers(name, version)
        self._new = asyncio.Event()

    async def listen(self) -> None:
        """Take what comes until cancelled."""
        topics = {self.name.topic(kind): kind for kind in KINDS}
        async for message in self._client.messages:
            kind = topics.get(str(message.topic))
            if kind is not None and isinstance(message.payload, bytes):
                self.seen.append(_seen(kind, message))
                self._new.set()

    def all(self, kind: Kind) -> list[Seen]:
        """All messages of a topic."""
        return [one for one in self.seen if one.kind is kind]

    def state(self) -> State:
        """The latest state; raises ``NotTried``."""
        for one in reversed(self.seen):
            if isinstance(one.message, State):
                return one.message
        raise NotTried("the robot has sent no state that can be read")

    async def until(self, condition: Callable[[], Any], missing: str, within_s: float | None = None) -> None:
        """Wait for something to be true; raises ``Failed`` with what is missing."""
        try:
            async with asyncio.timeout(within_s or self.patience_s):
                while not condition():
                    self._new.clear()
                    await self._new.wait()
        except TimeoutError:
            raise Failed(missing) from None

    async def until_state(
        self, condition: Callable[[State], Any], missing: str, within_s: float | None = None
    ) -> State:
        """Wait for such a state, of those that come from now on."""
        begun = len(self.seen)

        def found() -> State | None:
            new = (one.message for one in self.seen[begun:])
            return next((one for one in new if isinstance(one, State) and condition(one)), None)

        await self.until(found, missing, within_s)
        state = found()
        assert state is not None  # noqa: S101 - it was just found
        return state

    async def send(self, kind: Kind, data: bytes) -> None:
        """Publish bytes to the robot."""
        await self._client.publish(self.name.topic(kind), data, qos=0)

    async def publish(self, kind: Kind, message: Message) -> None:
        """Publish a message with a header of now."""
        await self.send(kind, encode(replace(message, **self._headers.next(kind, time.time()))))

    def header(self) -> dict[str, Any]:
        """A header for a message that ``publish`` gives its own."""
        return self._headers.next(Kind.FACTSHEET, time.time())

    async def act(self, kind: str, **parameters: Any) -> str:
        """Ask for an instant action; its id."""
        number = f"check-{uuid.uuid4()}"
        given = tuple(ActionParameter(key=key, value=value) for key, value in parameters.items())
        action = Action(
            action_type=kind,
            action_id=number,
            blocking_type=BlockingType.NONE,
            action_parameters=given or None,
        )
        await self.publish(Kind.INSTANT_ACTIONS, InstantActions(**self.header(), actions=(action,)))
        return number

    async def acted(self, kind: str, expected: ActionStatus, within_s: float | None = None) -> State:
        """Ask for an instant action, and wait for its end; raises ``Failed`` where it is another."""
        number = await self.act(kind)
        state = await self.until_state(
            lambda state: status(state, number) in ENDED,
            f"{kind} has no actionState that ends",
            within_s,
        )
        if (found := status(state, number)) is not expected:
            raise Failed(f"{kind} is {found}, expected {expected}")
        return state

    async def refused(self, order: Order, *reasons: Reason) -> State:
        """Send an order that has to be refused for one of these reasons; the state with its error."""
        before = self.state()
        await self.publish(Kind.ORDER, order)
        wanted = names(reasons, self.version)
        state = await self.until_state(
            lambda state: any(one.error_type in wanted for one in errors_about(state, order.order_id)),
            f"no error of the type {' or '.join(sorted(wanted))} that is about the order",
        )
        if (state.order_id, state.order_update_id) != (before.order_id, before.order_update_id):
            raise Failed("the order was taken over")
        return state


def errors_about(state: State, order_id: str) -> list[Error]:
    """The errors that name this order, or none at all."""
    found = []
    for error in state.errors:
        ids = [one.reference_value for one in error.error_references or () if one.reference_key == "orderId"]
        if order_id in ids or not ids:
            found.append(error)
    return found


def status(state: State, action_id: str) -> ActionStatus | None:
    """The status of an action; None: it is not there."""
    found = (one.action_status for one in state.all_action_states if one.action_id == action_id)
    return next(found, None)


def _seen(kind: Kind, message: aiomqtt.Message) -> Seen:
    data = message.payload
    assert isinstance(data, bytes)  # noqa: S101 - the caller has looked
    decoded: Header | None = None
    with contextlib.suppress(MalformedMessage):
        decoded = decode(data, KINDS[kind])
    return Seen(kind, data, bool(message.retain), message.qos, time.time(), decoded)


@contextlib.asynccontextmanager
async def session(
    parameters: BrokerParameters, name: RobotName, patience_s: float, version: str = versions.V2.number
) -> AsyncIterator[Session]:
    """Listen to a robot, and speak this version to it."""
    async with aiomqtt.Client(
        parameters.host,
        parameters.port,
        username=parameters.user,
        password=parameters.password,
        tls_context=parameters.tls,
        socket_options=NO_DELAY,
    ) as client:
        now = Session(client, name, patience_s, version)
        task = asyncio.create_task(now.listen())
        try:
            for kind in KINDS:
                await client.subscribe(name.topic(kind), qos=1)
            yield now
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
