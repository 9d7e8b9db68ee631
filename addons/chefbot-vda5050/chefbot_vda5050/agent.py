"""The robot's side of the interface: takes orders in, has the robot carry them out, reports its state.

It knows neither MQTT nor the robot's daemon: ``broker`` hands it messages and takes what is to be published, and
``robot.Robot`` drives. All that is decided is decided in ``acceptance`` and ``order``.
"""

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, Final

import msgspec
import structlog

from chefbot_vda5050 import acceptance, order, versions
from chefbot_vda5050.inbox import Inbox
from chefbot_vda5050.instant import instant_action
from chefbot_vda5050.messages import Message, Node, OperatingMode, Order, encode
from chefbot_vda5050.problems import Problem, Reason
from chefbot_vda5050.robot import CannotDo, DriveFailed, Robot, perform
from chefbot_vda5050.state import is_driving, state, visualization
from chefbot_vda5050.topics import Headers, Kind, RobotName
from chefbot_vda5050.vehicle import (
    Cancel,
    DriveTo,
    Effect,
    Facts,
    Limits,
    Pause,
    Resume,
    Send,
    Start,
    Stop,
    Vehicle,
)
from chefbotd.logs import RateLimitedLog

log = structlog.get_logger("vda5050")

VERSION: Final = versions.V2.number
"""Where nothing else is agreed on: what masters speak."""

STATE_EVERY_S: Final = 30.0
"""At least (6.10)."""

STATE_PAUSE_S: Final = 0.05
"""Changes that come closer together are one message (6.10)."""

RETRY_S: Final = 3.0
MOST_WAITING: Final = 64
AT_ONCE: Final = 8
"""So many ways are planned in one turn of the robot's worker."""

Publish = Callable[[Kind, bytes], Awaitable[None]]
MakeFactsheet = Callable[[dict[str, Any]], Message]


class _Waiting(msgspec.Struct):
    """An order that has come and is not accepted yet; ``is_cancelled``: its cancellation has come as well.

    ``stops`` are the robot's when it came; None: the robot was stopped then.
    """

    order: Order
    stops: int | None
    is_cancelled: bool = False


class Agent:
    """One robot in a fleet. ``vehicle`` is what it remembers of its order."""

    def __init__(
        self,
        name: RobotName,
        robot: Robot,
        publish: Publish,
        *,
        factsheet: MakeFactsheet,
        limits: Limits,
        visualization_s: float = 1.0,
        clock: Callable[[], float] = time.time,
        headers: Headers | None = None,
    ) -> None:
        self.vehicle = Vehicle()
        self.headers = headers or Headers(name, VERSION)
        self._robot, self._publish, self._limits = robot, publish, limits
        self._factsheet, self._visualization_s, self._clock = factsheet, visualization_s, clock
        self._inbox = Inbox(name, self.headers.version, limits.order_max_age_s, clock)
        self._waiting: deque[_Waiting] = deque()  # the first is being judged
        self._arrived = asyncio.Event()
        self._changed = asyncio.Event()
        self._was_armed, self._was_mode = True, OperatingMode.AUTOMATIC
        self._stop_number = self._stops = 0  # the robot's, and how often it was stopped
        self._last_state = 0  # its headerId
        self._drives = 0  # that were begun or given up
        self._reported: object = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._running: dict[str, asyncio.Task[None]] = {}
        self._online = False
        self._log = RateLimitedLog(log)

    async def run(self) -> None:
        """Work until cancelled."""
        self._robot.listen(self._take_facts, self._go_on)
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._take_orders())
                tasks.create_task(self._report())
                if self._visualization_s:
                    tasks.create_task(self._visualize())
        finally:
            for task in list(self._tasks):
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def receive(self, kind: Kind, data: bytes, *, retained: bool = False) -> None:
        """Take a message from the broker: instant actions at once, orders in turn.

        Where too many orders wait, the newest is dropped, as a master sends it again. An empty message clears what the
        broker had kept, and says nothing.
        """
        if not data:
            return
        if kind is Kind.ORDER:
            self._receive_order(data, retained=retained)
            return
        actions, rejection = self._inbox.actions(data, retained=retained)
        if rejection is not None:
            self._reject(rejection)
        for action in actions:
            if action.action_type == "cancelOrder":
                self._cancel_waiting(action.parameter("orderId"))
            self._apply(instant_action(self.vehicle, action))

    def set_online(self, online: bool) -> None:
        """The broker is there, or it is gone; there, everything is reported anew."""
        was, self._online = self._online, online
        if online:
            self._spawn(self._send_factsheet())
            self._changed.set()
        elif was and self.vehicle.base:
            self._tell("I have lost my fleet. I drive to the end of my way, and wait there.")
        elif was:
            self._say_if_waiting()

    # messages

    def _receive_order(self, data: bytes, *, retained: bool) -> None:
        message = self._inbox.order(data, retained=retained)
        if isinstance(message, Problem):
            self._reject(message)
        elif len(self._waiting) >= MOST_WAITING:
            log.warning("an order is dropped: too many wait", order=message.order_id)
        else:
            self._waiting.append(_Waiting(message, self._stops if self._robot.facts.armed else None))
            self._arrived.set()

    def _cancel_waiting(self, order_id: Any) -> None:
        """Orders that came before their cancellation must not begin after it."""
        for waiting in self._waiting:
            if order_id in (None, waiting.order.order_id):
                waiting.is_cancelled = True

    async def _take_orders(self) -> None:
        while True:
            await self._arrived.wait()
            while self._waiting:
                await self._try_order(self._waiting[0])
                self._waiting.popleft()
            self._arrived.clear()

    async def _try_order(self, waiting: "_Waiting") -> None:
        """Take it; a mistake of ours ends neither the program nor the orders that come after it."""
        try:
            await self._take_order(waiting)
        except Exception as problem:
            message = waiting.order
            log.exception("an order cannot be judged", order=message.order_id)
            about = (("topic", "order"), ("orderId", message.order_id))
            text = f"the robot's program has a fault with this order, which is in its log: {problem!r:.200}"
            self._reject(Problem(Reason.MALFORMED, text, about))

    async def _take_order(self, waiting: "_Waiting") -> None:
        """Judge it anew when it is known that there is a way: that takes its time."""
        message, judged = waiting.order, self._judge(waiting)
        if judged in (acceptance.Accepted.NEW, acceptance.Accepted.UPDATE):
            judged = await self._without_route(waiting) or self._judge(waiting)
        if isinstance(judged, Problem):
            log.warning("an order is refused", order=message.order_id, why=judged.text)
            self._apply(order.reject(self.vehicle, judged))
        else:
            log.info("an order is taken", order=message.order_id, update=message.order_update_id, how=judged)
            is_old = waiting.stops != self._stops  # it came before a stop, or while the robot was stopped
            self._apply(
                order.accept(self.vehicle, message, judged, self._robot.facts, self._limits, is_old=is_old),
                always=True,
            )

    def _judge(self, waiting: "_Waiting") -> acceptance.Accepted | Problem:
        message = waiting.order
        if waiting.is_cancelled:
            text = f"order {message.order_id!a} was cancelled before it began"
            about = (("topic", "order"), ("orderId", message.order_id))
            return Problem(Reason.CANCELLED_ORDER, text, about)
        late = self._inbox.late_by_now(message)
        return late or acceptance.judge(self.vehicle, message, self._robot.facts, self._limits)

    async def _without_route(self, waiting: "_Waiting") -> Problem | None:
        """6.1.4.8 of version 3.0: a node that the robot cannot reach on its map."""
        message = waiting.order
        nodes = [(one, one.node_position) for one in message.nodes[1:] if one.node_position is not None]
        for some in (nodes[first : first + AT_ONCE] for first in range(0, len(nodes), AT_ONCE)):
            found = await asyncio.gather(*(self._robot.unreachable(position) for _, position in some))
            if waiting.is_cancelled:
                return None
            for (node, _), why in zip(some, found, strict=True):
                if why:
                    about = (
                        ("topic", "order"),
                        ("orderId", message.order_id),
                        ("orderUpdateId", str(message.order_update_id)),
                        ("nodeId", node.node_id),
                    )
                    text = f"node {node.node_id!a} cannot be reached: {why}"
                    return Problem(Reason.NO_ROUTE, text, about)
        return None

    def _reject(self, rejection: Problem) -> None:
        log.warning("a message is refused", why=rejection.text)
        self._apply(order.reject(self.vehicle, rejection))

    # what the robot is to do

    def _apply(self, step: order.Step, *, always: bool = False) -> None:
        before, (self.vehicle, effects) = self.vehicle, step
        for effect in effects:
            self._carry_out(effect)
        if always or self.vehicle is not before:
            self._changed.set()

    def _carry_out(self, effect: Effect) -> None:
        match effect:
            case DriveTo(node, max_speed_m_s):
                self._drives += 1
                self._spawn(self._drive(self._drives, node, max_speed_m_s, self._stops))
            case Stop():
                self._drives += 1
                self._spawn(self._stop())
            case Pause(action_id):
                self._drives += 1
                self._spawn(self._pause(action_id))
            case Resume():
                self._spawn(self._resume())
            case Start(action):
                self._running[action.action_id] = self._spawn(self._perform(action))
            case Cancel(action_id):
                if action_id in self._running:
                    self._running.pop(action_id).cancel()
            case Send(what):
                if what == "factsheet":
                    self._spawn(self._send_factsheet())
                self._changed.set()

    async def _drive(self, number: int, node: Node, max_speed_m_s: float | None, stops: int) -> None:
        """The end of a drive counts while it is the latest, and nobody has given it up.

        It does not begin where the robot was stopped since there were so many ``stops``.
        """
        if node.node_position is None:
            raise ValueError(f"node {node.node_id!a} has no position: such an order is refused")
        sequence_id = node.sequence_id
        try:
            if stops != self._stops:
                raise DriveFailed("the robot was stopped before it began", by_people=True)
            await self._robot.drive_to(node.node_position, max_speed_m_s)
        except DriveFailed as failed:
            if number != self._drives:
                return
            log.warning("the robot has not reached a node", why=failed.reason)
            self._apply(
                order.drive_failed(
                    self.vehicle, sequence_id, failed.reason, failed.hint, by_people=failed.by_people
                )
            )
            await asyncio.sleep(RETRY_S)
            self._apply(order.retry(self.vehicle))
        else:
            if number == self._drives:
                self._apply(order.node_reached(self.vehicle, sequence_id))
                self._say_if_waiting()

    def _say_if_waiting(self) -> None:
        if not self._online and not self.vehicle.base and self.vehicle.nodes:
            self._tell("I wait here until my fleet is back.")

    async def _stop(self) -> None:
        await self._robot.stop()
        self._apply(order.stopped(self.vehicle))

    async def _pause(self, action_id: str) -> None:
        await self._robot.stop()
        self._apply(order.paused(self.vehicle, action_id))

    async def _resume(self) -> None:
        await self._robot.resume()

    async def _perform(self, action: Any) -> None:
        ended = await perform(self._robot, action)
        self._running.pop(action.action_id, None)
        self._apply(
            order.action_ended(
                self.vehicle, action.action_id, failed=ended.failed, result=ended.result, load=ended.load
            )
        )

    def _go_on(self) -> None:
        self._apply(order.unpaused(self.vehicle))

    def _tell(self, text: str) -> None:
        async def say() -> None:
            try:
                await self._robot.say(text)
            except CannotDo as error:
                log.info("nobody was told", text=text, why=str(error))

        self._spawn(say())

    def _spawn(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("a step of the order has failed", exc_info=error)

    # what is reported

    def _take_facts(self) -> None:
        """Report what has changed of the robot, count a node that it drives over, and pause when it was stopped."""
        facts, was_armed, was_mode = self._robot.facts, self._was_armed, self._was_mode
        self._was_armed, self._was_mode = facts.armed, facts.mode
        before, self._stop_number = self._stop_number, facts.stop_number
        if (was_armed and not facts.armed) or (before and facts.stop_number != before):
            self._stops += 1
            self._apply(order.robot_disarmed(self.vehicle))
        if facts.mode is not was_mode:
            self._apply(order.mode_changed(self.vehicle, facts.mode))
        node = self.vehicle.passed_node()
        if node is not None and node.node_position is not None:
            near_m = node.node_position.allowed_deviation_xy or self._limits.passing_tolerance_m
            if facts.distance_m(node.node_position) <= near_m:
                self._apply(order.node_reached(self.vehicle, node.sequence_id))
        if (now := _reportable(facts)) != self._reported:
            self._reported = now
            self._changed.set()

    async def _report(self) -> None:
        while True:
            try:
                async with asyncio.timeout(STATE_EVERY_S):
                    await self._changed.wait()
            except TimeoutError:
                pass  # it is time
            self._changed.clear()
            await self._send("state", self._send_state)
            await asyncio.sleep(STATE_PAUSE_S)

    async def _send(self, what: str, send: Callable[[], Awaitable[None]]) -> None:
        """Send a message; one that cannot be made is logged, and the next one tried."""
        try:
            await send()
        except Exception as problem:  # noqa: BLE001 - told and counted: one message must not end the program
            self._log.warning("a message cannot be sent", what=what, why=repr(problem)[:500])

    async def _send_state(self) -> None:
        header = self.headers.next(Kind.STATE, self._clock())
        self._last_state = header["header_id"]
        message = state(self.vehicle, self._robot.facts, header, self._limits)
        await self._publish(Kind.STATE, encode(message))

    async def _visualize(self) -> None:
        while True:
            await asyncio.sleep(self._visualization_s)
            if self._online and self._robot.facts.map_id:
                await self._send("visualization", self._send_visualization)

    async def _send_visualization(self) -> None:
        header = self.headers.next(Kind.VISUALIZATION, self._clock())
        message = visualization(self._robot.facts, header, self._limits, self._last_state)
        await self._publish(Kind.VISUALIZATION, encode(message))

    async def _send_factsheet(self) -> None:
        header = self.headers.next(Kind.FACTSHEET, self._clock())
        await self._publish(Kind.FACTSHEET, encode(self._factsheet(header)))


def _reportable(facts: Facts) -> object:
    """What of the facts is worth a message at once: all but numbers that change all the time."""
    still = msgspec.structs.replace(
        facts,
        x_m=0.0,
        y_m=0.0,
        heading_rad=0.0,
        fit=None,
        linear_m_s=0.0,
        angular_rad_s=0.0,
        path=(),
        charge_percent=None if facts.charge_percent is None else round(facts.charge_percent),
        voltage_v=None,
    )
    return still, is_driving(facts)
