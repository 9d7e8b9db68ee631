"""The steps of an order: what has happened in, the next state and what the robot is to do out. No clock, no I/O.

The robot drives from node to node, and over nodes at which nothing is to be done without a stop. Actions of a node begin
when it is reached; those that block keep the robot there (6.12).
"""

from collections.abc import Iterable

from msgspec.structs import replace

from chefbot_vda5050.acceptance import Accepted
from chefbot_vda5050.actions import Event, Tracked
from chefbot_vda5050.messages import ENDED, ActionStatus, Load, Node, OperatingMode, Order
from chefbot_vda5050.problems import AFTER_STOP, OF_ORDERS, Problem, Reason
from chefbot_vda5050.vehicle import (
    ALONE,
    BLOCKS_DRIVING,
    CLEARING,
    FOR_ORDERS,
    NEXT,
    Cancel,
    DriveTo,
    Effect,
    Facts,
    Limits,
    OrderEvent,
    Phase,
    Resume,
    Start,
    Stop,
    Vehicle,
)

Step = tuple[Vehicle, tuple[Effect, ...]]


def accept(
    vehicle: Vehicle,
    order: Order,
    accepted: Accepted,
    facts: Facts,
    limits: Limits,
    *,
    is_old: bool = False,
) -> Step:
    """Take over an order that was judged; where it came before a stop (``is_old``), it waits for a person."""
    if accepted is Accepted.REPEATED:
        return vehicle, ()
    vehicle = replace(vehicle, paused=vehicle.paused or is_old)
    event = OrderEvent.NEW if accepted is Accepted.NEW else OrderEvent.UPDATE
    phase = NEXT[vehicle.phase, event]
    problems = vehicle.without(*OF_ORDERS, Reason.DRIVE)
    if accepted is Accepted.NEW:
        problems = ()
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
        problems=problems,
    )
    if accepted is Accepted.NEW and _stands_on(nodes[0], facts, limits):
        vehicle = _traverse(vehicle, nodes[0])
    if is_old:
        references = (("orderId", order.order_id), ("orderUpdateId", str(order.order_update_id)))
        text = "the robot was stopped before the order began"
        vehicle = vehicle.with_problem(Problem(Reason.DRIVE, text, references, AFTER_STOP))
    return proceed(vehicle)


def reject(vehicle: Vehicle, problem: Problem) -> Step:
    """Report why an order was refused; the robot goes on with what it does."""
    return vehicle.with_problem(problem), ()


def node_reached(vehicle: Vehicle, sequence_id: int) -> Step:
    """The robot is at the node that it was told to drive to."""
    node = vehicle.nodes[0] if vehicle.nodes else None
    if node is None or node.sequence_id != sequence_id or vehicle.driving_to != sequence_id:
        return vehicle, ()
    problems = vehicle.without(Reason.DRIVE)
    return proceed(_traverse(replace(vehicle, driving_to=None, problems=problems), node))


def drive_failed(
    vehicle: Vehicle, sequence_id: int, reason: str, hint: str, *, by_people: bool = False
) -> Step:
    """The robot has not reached the node; ``by_people``: somebody at it has stopped it, and it waits."""
    if vehicle.driving_to != sequence_id:
        return vehicle, ()
    references = (
        ("orderId", vehicle.order_id),
        ("orderUpdateId", str(vehicle.order_update_id)),
        ("nodeId", vehicle.nodes[0].node_id),
    )
    vehicle = vehicle.with_problem(Problem(Reason.DRIVE, reason, references, hint))
    paused = vehicle.paused or by_people
    return replace(vehicle, driving_to=None, paused=paused), ()


def robot_disarmed(vehicle: Vehicle) -> Step:
    """Somebody or a fault has stopped the robot for good: its order waits, also where no drive was under way."""
    return replace(vehicle, paused=vehicle.paused or vehicle.phase is Phase.ACTIVE), ()


def stopped(vehicle: Vehicle) -> Step:
    """The robot stands after ``Stop``."""
    return proceed(replace(vehicle, stopping=False))


def paused(vehicle: Vehicle, action_id: str) -> Step:
    """The robot stands after ``Pause``."""
    return proceed(changed(replace(vehicle, stopping=False), action_id, Event.SUCCEED))


def action_ended(
    vehicle: Vehicle, action_id: str, *, failed: str = "", result: str | None = None, load: Load | None = None
) -> Step:
    """An action is over; ``failed`` says why it has failed. ``load`` was taken by a pick."""
    before = next((one for one in vehicle.actions if one.action.action_id == action_id), None)
    if before is None or before.status in ENDED:
        return vehicle, ()
    failure = Event.FAIL_FOR_NOW if before.action.retriable else Event.FAIL
    vehicle = changed(vehicle, action_id, failure if failed else Event.SUCCEED, failed or result)
    if failed:
        references = (("actionId", action_id),)
        text = f"{before.action.action_type}: {failed}"
        vehicle = vehicle.with_problem(Problem(Reason.ACTION, text, references))
    elif load is not None:
        vehicle = replace(vehicle, loads=(load,))
    elif before.action.action_type == "drop":
        vehicle = replace(vehicle, loads=())
    elif isinstance(node_id := before.action.parameter("lastNodeId"), str):
        vehicle = replace(vehicle, last_node_id=node_id)
    return proceed(vehicle)


def give_up(vehicle: Vehicle, why: str) -> Step:
    """Stop, and delete the order when the robot stands and its actions have ended (6.6.3); there is an order."""
    running = vehicle.running()
    for one in vehicle.actions:
        if one.sequence_id is not None:
            vehicle = changed(vehicle, one.action.action_id, Event.CANCEL, why)
    is_driving = vehicle.driving_to is not None
    effects: list[Effect] = [Cancel(one.action.action_id) for one in running]
    if is_driving:
        effects.append(Stop())
    vehicle = replace(
        vehicle,
        phase=NEXT[vehicle.phase, OrderEvent.CANCEL],
        driving_to=None,
        stopping=vehicle.stopping or is_driving,
        problems=vehicle.without(Reason.DRIVE),
    )
    vehicle, more = proceed(vehicle)
    return vehicle, (*effects, *more)


def mode_changed(vehicle: Vehicle, mode: OperatingMode) -> Step:
    """Somebody else drives the robot, or nobody else any more: some modes delete the order (6.10.6)."""
    if mode in FOR_ORDERS:
        return replace(vehicle, problems=vehicle.without(Reason.NOT_AVAILABLE)), ()
    forgets = mode in CLEARING and mode is not OperatingMode.MANUAL
    vehicle = replace(vehicle, last_node_id="") if forgets else vehicle
    if mode not in CLEARING or (vehicle.phase, OrderEvent.CANCEL) not in NEXT:
        return vehicle, ()
    return give_up(vehicle, f"the operating mode is {mode}")


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
        vehicle = changed(vehicle, one.action.action_id, Event.START)
        effects.append(Start(one.action))
    node = vehicle.next_node()
    is_held = vehicle.paused or vehicle.stopping or vehicle.driving_to is not None
    if node is not None and vehicle.may_drive() and not is_held:
        vehicle = replace(vehicle, driving_to=node.sequence_id)
        effects.append(DriveTo(node, vehicle.max_speed_m_s(node)))
    if not vehicle.nodes and not vehicle.has_open_actions():
        vehicle = replace(vehicle, phase=NEXT[vehicle.phase, OrderEvent.ALL_DONE])
    return vehicle, tuple(effects)


def _startable(vehicle: Vehicle) -> Iterable[Tracked]:
    """The actions that may begin beside those that run, in their sequence: some only alone (6.12)."""
    running = [one.action.blocking_type for one in vehicle.running()]
    for one in vehicle.triggered():
        blocking = one.action.blocking_type
        if ALONE & set(running) or (blocking in ALONE and running):
            return
        if blocking in BLOCKS_DRIVING and vehicle.driving_to is not None:
            return
        running.append(blocking)
        yield one


def _end_cancelling(vehicle: Vehicle) -> Vehicle:
    if vehicle.stopping or vehicle.running():
        return vehicle
    for one in vehicle.actions:
        if one.action.action_type == "cancelOrder":
            vehicle = changed(vehicle, one.action.action_id, Event.SUCCEED)
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


def changed(vehicle: Vehicle, action_id: str, event: Event, result: str | None = None) -> Vehicle:
    """The vehicle after something has happened to an action."""
    after = tuple(
        one.after(event, result) if one.action.action_id == action_id else one for one in vehicle.actions
    )
    return replace(vehicle, actions=after)
