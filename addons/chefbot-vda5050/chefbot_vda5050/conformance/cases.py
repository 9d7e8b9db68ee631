"""The cases, each with its section of 2.1 and of 3.0. Those that have the robot drive are tried only when asked for."""

import asyncio
import math
import time
import uuid
from collections.abc import Awaitable, Callable
from typing import Any, Final

from msgspec import Struct
from msgspec.structs import replace

from chefbot_vda5050 import schemas, versions
from chefbot_vda5050.conformance.session import Failed, NotTried, Session, errors_about, status
from chefbot_vda5050.messages import (
    ENDED,
    Action,
    ActionStatus,
    BlockingType,
    Connection,
    ConnectionState,
    Edge,
    Node,
    NodePosition,
    Order,
    State,
)
from chefbot_vda5050.problems import Reason, names
from chefbot_vda5050.topics import Kind, seconds_of

STATE_EVERY_S, CLOCKS_S = 30.0, 10.0
DRIVE_S: Final = 120.0
CONTINUATION: Final = (Reason.NO_CONTINUATION, Reason.MALFORMED)
"""Version 3.0 names no error for an update that does not go on where the base ends."""


class Case(Struct, frozen=True):
    """What is tried; ``moves``: the robot drives."""

    sections: tuple[str, str]
    title: str
    run: Callable[[Session, float], Awaitable[None]]
    moves: bool = False

    def section(self, version: str) -> str:
        """Where this version says so."""
        return self.sections[versions.of(version) is versions.V3]


CASES: Final[list[Case]] = []
Run = Callable[[Session, float], Awaitable[None]]


def case(section_2_1: str, section_3_0: str, title: str, *, moves: bool = False) -> Callable[[Run], Run]:
    """Add a case; it gets the session, and how many metres the robot may drive forwards."""

    def add(run: Run) -> Run:
        CASES.append(Case((section_2_1, section_3_0), title, run, moves))
        return run

    return add


@case("6.14", "6.5", "the connection is ONLINE, retained, with QoS 1")
async def _connection(session: Session, _: float) -> None:
    await session.until(lambda: session.all(Kind.CONNECTION), "no connection message is retained")
    first, last = session.all(Kind.CONNECTION)[0], session.all(Kind.CONNECTION)[-1]
    if not first.retained or first.qos != 1:
        raise Failed(f"retained is {first.retained}, QoS {first.qos}")
    if (
        not isinstance(last.message, Connection)
        or last.message.connection_state is not ConnectionState.ONLINE
    ):
        raise Failed(f"it is {last.data.decode(errors='replace')[:80]}")


@case("6.8.1", "6.2.3.2", "stateRequest is answered by a state and is FINISHED")
async def _state_request(session: Session, _: float) -> None:
    await session.acted("stateRequest", ActionStatus.FINISHED)


@case("6.15", "6.10", "factsheetRequest is answered by the factsheet, which is retained")
async def _factsheet(session: Session, _: float) -> None:
    if not any(one.retained for one in session.all(Kind.FACTSHEET)):
        raise Failed("no factsheet is retained")
    before = len(session.all(Kind.FACTSHEET))
    await session.act("factsheetRequest")
    await session.until(lambda: len(session.all(Kind.FACTSHEET)) > before, "no factsheet came")


@case("6.9", "6.2.1", "an instant action that nobody has defined is FAILED")
async def _unknown_action(session: Session, _: float) -> None:
    await session.acted("checkUnknownAction", ActionStatus.FAILED)


@case("6.6.3.2", "6.1.3.2", "cancelOrder without an order is FAILED, with its error about the action")
async def _cancel_nothing(session: Session, _: float) -> None:
    _must_be_idle(session.state())
    state = await session.acted("cancelOrder", ActionStatus.FAILED)
    expected = names([Reason.NO_ORDER_TO_CANCEL], session.version)
    found = [one for one in state.errors if one.error_type in expected]
    if not found:
        raise Failed(f"no error {' or '.join(expected)}")
    if not any(reference.reference_key == "actionId" for reference in found[0].error_references or ()):
        raise Failed("its references do not name the actionId")


@case("6.6.4.1", "6.1.4.1", "a message that is no JSON is reported")
async def _no_json(session: Session, _: float) -> None:
    await session.send(Kind.ORDER, b'{"orderId": ')
    await _validation_error(session)


@case("6.6.4.1", "6.1.4.1", "an order with too few edges is refused")
async def _too_few_edges(session: Session, _: float) -> None:
    order = _order(session, 0.0, 0.1)
    await session.refused(replace(order, edges=()), Reason.MALFORMED)


@case("6.6.4.2", "6.1.4.3", "an order with an unknown action is refused")
async def _bad_action(session: Session, _: float) -> None:
    action = Action(
        action_type="checkUnknownAction", action_id=f"check-{uuid.uuid4()}", blocking_type=BlockingType.HARD
    )
    order = _order(session, 0.0)
    nodes = (replace(order.nodes[0], actions=(action,)),)
    await session.refused(replace(order, nodes=nodes), Reason.UNSUPPORTED_ACTION)


@case("6.6.1", "6.1.4.7", "an order that begins 1 km away is refused")
async def _too_far(session: Session, _: float) -> None:
    reasons = [Reason.START_OUT_OF_RANGE]
    if session.version[0] == "2":  # it names no error for this
        reasons.append(Reason.OTHER_ORDER)
    await session.refused(_order(session, 1000.0), *reasons)


@case("6.7", "6.1.4.10", "an order on an unknown map is refused")
async def _unknown_map(session: Session, _: float) -> None:
    order = _order(session, 0.0)
    position = order.nodes[0].node_position
    assert position is not None  # noqa: S101 - made by _order
    nodes = (replace(order.nodes[0], node_position=replace(position, map_id=f"check-{uuid.uuid4()}")),)
    reasons = [Reason.UNKNOWN_MAP]
    if session.version[0] == "2":  # it names no error for this
        reasons.append(Reason.NO_ROUTE)
    await session.refused(replace(order, nodes=nodes), *reasons)


@case("6.6.2", "6.1.2", "an order of one node where the robot stands is taken and finished", moves=True)
async def _stand(session: Session, _: float) -> None:
    _must_be_idle(session.state())
    order = _order(session, 0.0)
    await session.publish(Kind.ORDER, order)
    state = await session.until_state(
        lambda state: state.order_id == order.order_id and _is_idle(state), "it is not finished"
    )
    if errors_about(state, order.order_id) and state.last_node_id != order.nodes[0].node_id:
        raise Failed(f"lastNodeId is {state.last_node_id!a}")


@case(
    "6.6.1", "6.1.2", "the base is driven and the horizon is not; updates and refusals on the way", moves=True
)
async def _drive(session: Session, metres: float) -> None:
    _must_be_idle(session.state())
    order = _order(session, 0.0, metres / 2, metres, base=2)
    await session.publish(Kind.ORDER, order)
    await session.until_state(lambda state: state.order_id == order.order_id, "the order is not taken")
    await session.refused(_order(session, 0.0), Reason.OTHER_ORDER)
    await session.until_state(
        lambda state: state.last_node_id == order.nodes[1].node_id and not state.driving,
        "the last node of the base is not reached",
        DRIVE_S,
    )
    await asyncio.sleep(2.0)
    state = session.state()
    if [one.released for one in state.node_states] != [False]:
        raise Failed("nodeStates are not the horizon alone")
    await session.publish(Kind.ORDER, order)  # the same once more: nothing happens
    if versions.of(session.version) is versions.V3:  # version 2.1 does not say what another content is
        shorter = replace(order, nodes=order.nodes[:2], edges=order.edges[:1])
        await session.refused(shorter, Reason.SAME_UPDATE)
    wrong = replace(order, order_update_id=1)  # it begins at the first node, not at the last of the base
    await session.refused(wrong, *CONTINUATION)
    update = replace(order, order_update_id=2, nodes=order.nodes[1:2], edges=())
    await session.publish(Kind.ORDER, update)
    await session.until_state(
        lambda state: state.order_update_id == 2 and _is_idle(state), "the horizon was not deleted"
    )
    await session.refused(replace(update, order_update_id=1), Reason.OUTDATED_UPDATE)


@case("6.8.1", "6.2.3.2", "startPause halts the robot, stopPause lets it go on; then cancelOrder", moves=True)
async def _pause_and_cancel(session: Session, metres: float) -> None:
    _must_be_idle(session.state())
    order = _order(session, 0.0, -metres / 2)
    await session.publish(Kind.ORDER, order)
    await session.until_state(lambda state: state.driving, "the robot does not drive", DRIVE_S)
    state = await session.acted("startPause", ActionStatus.FINISHED, DRIVE_S)
    if not state.paused or state.driving:
        raise Failed(f"paused is {state.paused} and driving {state.driving} after startPause")
    await session.acted("stopPause", ActionStatus.FINISHED)
    number = await session.act("cancelOrder")
    state = await session.until_state(
        lambda state: status(state, number) in ENDED, "cancelOrder does not end", DRIVE_S
    )
    if state.node_states or state.edge_states or state.driving:
        raise Failed("the order is not deleted, or the robot drives on")
    if state.order_id != order.order_id:
        raise Failed("the orderId is not kept")


@case("6.10", "6.6", "a state comes at least every 30 s")
async def _interval(session: Session, _: float) -> None:
    within_s = STATE_EVERY_S + session.patience_s
    await session.until_state(lambda state: True, f"none came within {within_s:g} s", within_s)


@case("6.1", "7", "every message fits its schema")
async def _schemas(session: Session, _: float) -> None:
    for one in session.seen:
        if problems := schemas.problems(one.kind, one.data):
            raise Failed(f"{one.kind}: {problems[0]}")


@case("6.4", "7.2", "headers: ids grow by one for each topic; version, clock and the robot's name are right")
async def _headers(session: Session, _: float) -> None:
    for kind in (Kind.STATE, Kind.VISUALIZATION):
        ids = [one.message.header_id for one in session.all(kind) if one.message is not None]
        if ids != list(range(ids[0], ids[0] + len(ids))) if ids else False:
            raise Failed(f"{kind}: headerIds are {ids[:8]}")
    for one in session.seen:
        if one.message is None:
            raise Failed(f"{one.kind} cannot be read")
        if versions.of(one.message.version) is not versions.of(session.version):
            raise Failed(f"{one.kind} is of version {one.message.version}")
        of = (one.message.manufacturer, one.message.serial_number)
        if of != (session.name.manufacturer, session.name.serial_number):
            raise Failed(f"{one.kind} is of {'/'.join(of)}")
        age_s = one.arrival_s - seconds_of(one.message.timestamp)
        if not one.retained and abs(age_s) > CLOCKS_S:
            raise Failed(f"{one.kind}: its timestamp is {age_s:.1f} s from our clock")


async def _validation_error(session: Session) -> None:
    wanted = names([Reason.MALFORMED], session.version)
    await session.until_state(
        lambda state: any(one.error_type in wanted for one in state.errors), f"no {' or '.join(wanted)}"
    )


def _is_idle(state: State) -> bool:
    ended = all(one.action_status in ENDED for one in state.all_action_states)
    return not state.node_states and not state.edge_states and not state.driving and ended


def _must_be_idle(state: State) -> None:
    if not _is_idle(state):
        raise NotTried("the robot has an order")


def _order(session: Session, *along_m: float, base: int | None = None) -> Order:
    """A new order along the robot's heading, with nodes so far from it; the first ``base`` are released."""
    at = session.state().agv_position
    if at is None or not at.position_initialized:
        raise NotTried("the robot does not know where it is")
    base = len(along_m) if base is None else base
    nodes = tuple(
        Node(
            node_id=f"check-{index}",
            sequence_id=2 * index,
            released=index < base,
            actions=(),
            node_position=NodePosition(
                x=at.x + metres * math.cos(at.theta),
                y=at.y + metres * math.sin(at.theta),
                map_id=at.map_id,
                allowed_deviation_xy=0.3,
            ),
        )
        for index, metres in enumerate(along_m)
    )
    edges = tuple(
        Edge(
            edge_id=f"check-{index}-{index + 1}",
            sequence_id=2 * index + 1,
            released=index + 1 < base,
            start_node_id=f"check-{index}",
            end_node_id=f"check-{index + 1}",
            actions=(),
        )
        for index in range(len(along_m) - 1)
    )
    fields: dict[str, Any] = {"order_id": f"check-{uuid.uuid4()}", "order_update_id": 0}
    return Order(**session.header(), **fields, nodes=nodes, edges=edges)


class Result(Struct, frozen=True):
    """``outcome`` is passed, failed or not tried; ``text`` says why."""

    case: Case
    outcome: str
    text: str
    seconds: float


async def run_all(session: Session, metres: float | None) -> list[Result]:
    """Try all cases; without ``metres`` none that has the robot drive."""
    results = []
    for one in CASES:
        began_s = time.monotonic()
        if one.moves and metres is None:
            outcome, text = "not tried", "the robot may not drive (--move)"
        else:
            outcome, text = await _run(one, session, metres or 0.0)
        results.append(Result(one, outcome, text, time.monotonic() - began_s))
    return results


async def _run(one: Case, session: Session, metres: float) -> tuple[str, str]:
    try:
        await one.run(session, metres)
    except Failed as failed:
        return "failed", str(failed)
    except NotTried as why:
        return "not tried", str(why)
    return "passed", ""
