"""The steps of an order: what has happened in, the next state and what the robot is to do out. No clock, no I/O.

The robot drives from node to node, and over nodes at which nothing is to be done without a stop. Actions of a node begin
when it is reached; those that block keep the robot there (6.12).
"""

from collections.abc import Callable, Iterable
from typing import Final

from msgspec.structs import replace

from chefbot_vda5050 import actions
from chefbot_vda5050.acceptance import Accepted
from chefbot_vda5050.actions import Event, Scope, Tracked
from chefbot_vda5050.messages import (
    ENDED,
    Action,
    ActionStatus,
    BlockingType,
    Error,
    Level,
    Load,
    Node,
    Order,
    Reference,
)
from chefbot_vda5050.rejections import OF_ORDERS, Reason, Rejection
from chefbot_vda5050.vehicle import (
    NEXT,
    Cancel,
    DriveTo,
    Effect,
    Facts,
    Limits,
    OrderEvent,
    Pause,
    Phase,
    Resume,
    Send,
    Start,
    Stop,
    Vehicle,
)

Step = tuple[Vehicle, tuple[Effect, ...]]
DRIVE_ERROR: Final = "driveError"
ACTION_ERROR: Final = "actionError"
KEPT_INSTANT: Final = 32
"""So many instant actions that have ended are reported at most."""


def accept(vehicle: Vehicle, order: Order, accepted: Accepted, facts: Facts, limits: Limits) -> Step:
    """Take over an order that was judged."""
    if accepted is Accepted.REPEATED:
        return vehicle, ()
    event = OrderEvent.NEW if accepted is Accepted.NEW else OrderEvent.UPDATE
    phase = NEXT[vehicle.phase, event]
    errors = tuple(one for one in vehicle.errors if one.error_type not in (*OF_ORDERS, DRIVE_ERROR))
    if accepted is Accepted.NEW:
        errors = ()
        kept = tuple(one for one in vehicle.actions if one.sequence_id is None and one.status not in ENDED)
        nodes, edges = order.nodes, order.edges
        added = nodes
    else:
        known = [node.sequence_id for node in vehicle.nodes if not node.released]
        kept = tuple(one for one in vehicle.actions if one.sequence_id not in known)
        nodes = (*vehicle.base, *order.nodes[1:])
        edges = (*(edge for edge in vehicle.edges if edge.released), *order.edges)
        added = order.nodes[1:]
    tracked = tuple(
        Tracked(action, ActionStatus.WAITING, node.sequence_id) for node in added for action in node.actions
    )
    decision = [node for node in order.nodes if node.released][-1]
    vehicle = replace(
        vehicle,
        phase=phase,
        order=order,
        nodes=nodes,
        edges=edges,
        decision=decision if accepted is Accepted.NEW or decision is not order.nodes[0] else vehicle.decision,
        actions=(*kept, *tracked),
        errors=errors,
    )
    if accepted is Accepted.NEW and _stands_on(nodes[0], facts, limits):
        vehicle = _traverse(vehicle, nodes[0])
    return proceed(vehicle)


def reject(vehicle: Vehicle, rejection: Rejection) -> Step:
    """Report why an order was refused; the robot goes on with what it does."""
    error = rejection.error()
    others = tuple(one for one in vehicle.errors if one.error_type != error.error_type)
    return replace(vehicle, errors=(*others, error)), ()


def node_reached(vehicle: Vehicle, sequence_id: int) -> Step:
    """The robot is at the node that it was told to drive to."""
    node = vehicle.nodes[0] if vehicle.nodes else None
    if node is None or node.sequence_id != sequence_id or vehicle.driving_to != sequence_id:
        return vehicle, ()
    errors = tuple(one for one in vehicle.errors if one.error_type != DRIVE_ERROR)
    return proceed(_traverse(replace(vehicle, driving_to=None, errors=errors), node))


def drive_failed(
    vehicle: Vehicle, sequence_id: int, reason: str, hint: str, *, by_people: bool = False
) -> Step:
    """The robot has not reached the node; ``by_people``: somebody at it has stopped it, and it waits."""
    if vehicle.driving_to != sequence_id:
        return vehicle, ()
    error = Error(
        error_type=DRIVE_ERROR,
        error_level=Level.WARNING,
        error_description=reason,
        error_hint=hint,
        error_references=(
            Reference(reference_key="orderId", reference_value=vehicle.order_id),
            Reference(reference_key="nodeId", reference_value=vehicle.nodes[0].node_id),
        ),
    )
    others = tuple(one for one in vehicle.errors if one.error_type != DRIVE_ERROR)
    paused = vehicle.paused or by_people
    return replace(vehicle, driving_to=None, errors=(*others, error), paused=paused), ()


def robot_disarmed(vehicle: Vehicle) -> Step:
    """Somebody or a fault has stopped the robot for good: its order waits, also where no drive was under way."""
    return replace(vehicle, paused=vehicle.paused or vehicle.phase is Phase.ACTIVE), ()


def stopped(vehicle: Vehicle) -> Step:
    """The robot stands after ``Stop``."""
    return proceed(replace(vehicle, stopping=False))


def paused(vehicle: Vehicle, action_id: str) -> Step:
    """The robot stands after ``Pause``."""
    return proceed(_changed(replace(vehicle, stopping=False), action_id, Event.SUCCEED))


def action_ended(
    vehicle: Vehicle, action_id: str, *, failed: str = "", result: str | None = None, load: Load | None = None
) -> Step:
    """An action is over; ``failed`` says why it has failed. ``load`` was taken by a pick."""
    before = next((one for one in vehicle.actions if one.action.action_id == action_id), None)
    if before is None or before.status in ENDED:
        return vehicle, ()
    vehicle = _changed(vehicle, action_id, Event.FAIL if failed else Event.SUCCEED, failed or result)
    if failed:
        vehicle = _with_action_error(vehicle, before.action, failed)
    elif load is not None:
        vehicle = replace(vehicle, loads=(load,))
    elif before.action.action_type == "drop":
        vehicle = replace(vehicle, loads=())
    elif isinstance(node_id := before.action.parameter("lastNodeId"), str):
        vehicle = replace(vehicle, last_node_id=node_id)
    return proceed(vehicle)


def instant_action(vehicle: Vehicle, action: Action) -> Step:
    """Somebody asks for an action at once; the same ``actionId`` a second time changes nothing."""
    if any(one.action.action_id == action.action_id for one in vehicle.actions):
        return vehicle, ()
    tracked = Tracked(action, ActionStatus.RUNNING)
    vehicle = replace(vehicle, actions=(*_not_too_many(vehicle.actions), tracked))
    if text := actions.problem(action, Scope.INSTANT):
        return _refused(vehicle, action, Rejection(Reason.INSTANT_ACTION, text))
    step = INSTANT.get(action.action_type)
    return step(vehicle, action) if step else (vehicle, (Start(action),))


def _cancel_order(vehicle: Vehicle, action: Action) -> Step:
    order_id = action.parameter("orderId")
    phase = NEXT.get((vehicle.phase, OrderEvent.CANCEL))
    if phase is None or order_id not in (None, vehicle.order_id):
        text = "the robot has no order" if phase is None else f"the robot's order is {vehicle.order_id!a}"
        return _refused(vehicle, action, Rejection(Reason.NO_ORDER_TO_CANCEL, text))
    running = vehicle.running()
    for one in vehicle.actions:
        if one.sequence_id is not None:
            vehicle = _changed(vehicle, one.action.action_id, Event.CANCEL, "the order was cancelled")
    is_driving = vehicle.driving_to is not None
    effects: list[Effect] = [Cancel(one.action.action_id) for one in running]
    if is_driving:
        effects.append(Stop())
    errors = tuple(one for one in vehicle.errors if one.error_type != DRIVE_ERROR)
    stopping = vehicle.stopping or is_driving
    vehicle = replace(vehicle, phase=phase, driving_to=None, stopping=stopping, errors=errors)
    vehicle, more = proceed(vehicle)
    return vehicle, (*effects, *more)


def _start_pause(vehicle: Vehicle, action: Action) -> Step:
    """The drive is given up and begun anew: a goal that is still being accepted could not be halted."""
    stopping = vehicle.stopping or vehicle.driving_to is not None
    return replace(vehicle, paused=True, stopping=stopping, driving_to=None), (Pause(action.action_id),)


def _stop_pause(vehicle: Vehicle, action: Action) -> Step:
    vehicle = _changed(replace(vehicle, paused=False), action.action_id, Event.SUCCEED)
    vehicle, effects = proceed(vehicle)
    return vehicle, (Resume(), *effects)


def _send(what: str) -> Callable[[Vehicle, Action], Step]:
    def step(vehicle: Vehicle, action: Action) -> Step:
        return _changed(vehicle, action.action_id, Event.SUCCEED), (Send(what),)

    return step


INSTANT: Final[dict[str, Callable[[Vehicle, Action], Step]]] = {
    "cancelOrder": _cancel_order,
    "startPause": _start_pause,
    "stopPause": _stop_pause,
    "stateRequest": _send("state"),
    "factsheetRequest": _send("factsheet"),
}
"""The others are begun by ``Start``."""


def unpaused(vehicle: Vehicle) -> Step:
    """Somebody at the robot has it go on."""
    vehicle, effects = proceed(replace(vehicle, paused=False))
    return vehicle, (Resume(), *effects)


def retry(vehicle: Vehicle) -> Step:
    """Try to drive on after a drive has failed."""
    return proceed(vehicle)


def proceed(vehicle: Vehicle) -> Step:
    """Begin whatever can begin now."""
    if vehicle.phase is Phase.CANCELLING:
        return _end_cancelling(vehicle), ()
    if vehicle.phase is not Phase.ACTIVE:
        return vehicle, ()
    effects: list[Effect] = []
    for one in _startable(vehicle):
        vehicle = _changed(vehicle, one.action.action_id, Event.START)
        effects.append(Start(one.action))
    node = vehicle.next_node()
    is_held = vehicle.paused or vehicle.stopping or vehicle.driving_to is not None
    if node is not None and vehicle.may_drive() and not is_held:
        vehicle = replace(vehicle, driving_to=node.sequence_id)
        effects.append(DriveTo(node))
    if not vehicle.nodes and not vehicle.has_open_actions():
        vehicle = replace(vehicle, phase=NEXT[vehicle.phase, OrderEvent.ALL_DONE])
    return vehicle, tuple(effects)


def _startable(vehicle: Vehicle) -> Iterable[Tracked]:
    """The actions that may begin beside those that run, in their sequence: a HARD one only alone (6.12)."""
    running = [one.action.blocking_type for one in vehicle.running()]
    for one in vehicle.triggered():
        blocking = one.action.blocking_type
        if BlockingType.HARD in running or (blocking is BlockingType.HARD and running):
            return
        if blocking is not BlockingType.NONE and vehicle.driving_to is not None:
            return
        running.append(blocking)
        yield one


def _end_cancelling(vehicle: Vehicle) -> Vehicle:
    if vehicle.stopping or vehicle.running():
        return vehicle
    for one in vehicle.actions:
        if one.action.action_type == "cancelOrder":
            vehicle = _changed(vehicle, one.action.action_id, Event.SUCCEED)
    return replace(vehicle, phase=NEXT[vehicle.phase, OrderEvent.ALL_STOPPED], nodes=(), edges=())


def _stands_on(node: Node, facts: Facts, limits: Limits) -> bool:
    """The first node has been judged to be near; its heading counts where it has one."""
    position = node.node_position
    if position is None or position.theta is None:
        return True
    allowed_rad = max(position.allowed_deviation_theta or 0.0, limits.heading_tolerance_rad)
    return facts.turn_rad(position.theta) <= allowed_rad


def _traverse(vehicle: Vehicle, node: Node) -> Vehicle:
    """Count a node as reached, and the edge before it as left (6.10.2)."""
    return replace(
        vehicle,
        nodes=tuple(one for one in vehicle.nodes if one.sequence_id > node.sequence_id),
        edges=tuple(one for one in vehicle.edges if one.sequence_id > node.sequence_id),
        last_node_id=node.node_id,
        last_node_sequence_id=node.sequence_id,
    )


def _changed(vehicle: Vehicle, action_id: str, event: Event, result: str | None = None) -> Vehicle:
    after = tuple(
        one.after(event, result) if one.action.action_id == action_id else one for one in vehicle.actions
    )
    return replace(vehicle, actions=after)


def _refused(vehicle: Vehicle, action: Action, rejection: Rejection) -> Step:
    references = (("topic", "instantActions"), ("actionId", action.action_id))
    error = Rejection(rejection.reason, rejection.text, references).error()
    others = tuple(one for one in vehicle.errors if one.error_type != error.error_type)
    vehicle = replace(vehicle, errors=(*others, error))
    return _changed(vehicle, action.action_id, Event.FAIL, rejection.text), ()


def _with_action_error(vehicle: Vehicle, action: Action, text: str) -> Vehicle:
    error = Error(
        error_type=ACTION_ERROR,
        error_level=Level.WARNING,
        error_description=f"{action.action_type}: {text}",
        error_hint="Look after the action at the robot; then send it again or go on without it.",
        error_references=(Reference(reference_key="actionId", reference_value=action.action_id),),
    )
    others = tuple(one for one in vehicle.errors if one.error_type != ACTION_ERROR)
    return replace(vehicle, errors=(*others, error))


def _not_too_many(tracked: tuple[Tracked, ...]) -> tuple[Tracked, ...]:
    """Forget the oldest instant actions that have ended."""
    ended = [one for one in tracked if one.sequence_id is None and one.status in ENDED]
    forgotten = {one.action.action_id for one in ended[: max(0, len(ended) - KEPT_INSTANT + 1)]}
    return tuple(one for one in tracked if one.action.action_id not in forgotten)
