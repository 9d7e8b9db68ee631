"""A robot of VDA 5050 that does exactly what the standard says, in simulated time, and keeps a record of it."""

from chefbot_fleet.orders import Outgoing
from chefbot_fleet.roadmap import Roadmap
from chefbot_vda5050.messages import (
    ActionState,
    ActionStatus,
    BatteryState,
    Error,
    EStop,
    Level,
    Node,
    NodeState,
    OperatingMode,
    Position,
    Reference,
    SafetyState,
    State,
)


class StandardRobot:
    """Two seconds an edge and three an action. ``worked`` lists the actions that it has finished.

    With ``refuses`` it takes no order, for this reason; one that ``cannot_work`` takes none with an action. Driven by
    hand it takes none at all, and afterwards no update of the order that it has deleted.
    """

    def __init__(self, name: str, roadmap: Roadmap, node: int) -> None:
        self.name, self._roadmap = name, roadmap
        self.point = roadmap.points_m[node]
        self.worked: list[tuple[str, str]] = []
        self.refused: list[str] = []
        self.refuses: str | None = None
        self.cannot_work = False
        self.errors: tuple[Error, ...] = ()
        self.mode = OperatingMode.AUTOMATIC
        self._headers = self.stops = 0
        self.restart()

    def restart(self) -> None:
        """Forget the order; stand at the nearest node."""
        self.order, self.last = ("", 0), ("", 0)
        self.ahead: list[Node] = []
        self.end: Node | None = None
        self.actions: list[ActionState] = []
        self.instant: list[ActionState] = []
        self._begun_s: float | None = None
        self._work_s: float | None = None
        self._pending: list[tuple[str, str]] = []
        self._deleted = ""

    def cancel(self, action_id: str) -> None:
        """6.9.2: asked, and answered with the next step; the same id again changes nothing."""
        if all(one.action_id != action_id for one in self.instant):
            self.instant.append(ActionState(action_id=action_id, action_status=ActionStatus.RUNNING))

    def _stop(self) -> None:
        """Stand where it is, which is in the middle of an edge that it was on, and delete the order."""
        ended = ActionStatus.FINISHED if self.ahead or self._pending else ActionStatus.FAILED
        self.stops += ended is ActionStatus.FINISHED
        if self.ahead and self._begun_s is not None and (position := self.ahead[0].node_position) is not None:
            self.point = ((self.point[0] + position.x) / 2, (self.point[1] + position.y) / 2)
        failed = [ActionState(action_id=one, action_status=ActionStatus.FAILED) for one, _ in self._pending]
        self.actions += failed
        self.ahead, self._pending, self._begun_s, self._work_s = [], [], None, None
        running = [one for one in self.instant if one.action_status is ActionStatus.RUNNING]
        self.instant = [one for one in self.instant if one not in running]
        self.instant += [ActionState(action_id=one.action_id, action_status=ended) for one in running]

    def take_by_hand(self) -> None:
        """6.10.6: the order is deleted, and its id stays."""
        self.mode, self.ahead, self._pending, self._begun_s = OperatingMode.MANUAL, [], [], None
        self._deleted = self.order[0]

    def _refuse(self, order: Outgoing, why: str) -> None:
        self.refused.append(order.order_id)
        about = (Reference(reference_key="orderId", reference_value=order.order_id),)
        error = Error(
            error_type=why, error_level=Level.WARNING, error_references=about, error_description="a test"
        )
        self.errors = (error,)

    def receive(self, order: Outgoing) -> None:
        """6.6.2: a new order where none is active, or an update that continues the base."""
        if self.refuses is not None:
            return self._refuse(order, self.refuses)
        if self.cannot_work and any(node.actions for node in order.nodes):
            return self._refuse(order, "unsupportedAction")
        if self.mode is not OperatingMode.AUTOMATIC or order.order_id == self._deleted:
            return self._refuse(order, "orderError")
        self.errors = ()
        first, known = order.nodes[0], self.order[0] == order.order_id
        if known and order.update_id <= self.order[1]:
            return None
        if known:
            if self.end is None or (first.node_id, first.sequence_id) != (
                self.end.node_id,
                self.end.sequence_id,
            ):
                return self._refuse(order, "no continuation")
            self.ahead += order.nodes[1:]
        else:
            if self.ahead or self._pending:
                return self._refuse(order, "another order is active")
            assert first.node_position is not None
            x_m, y_m = self.point
            position = first.node_position
            if (position.x - x_m) ** 2 + (position.y - y_m) ** 2 > (position.allowed_deviation_xy or 0) ** 2:
                return self._refuse(order, "the first node is too far")
            self.last, self.ahead = (first.node_id, first.sequence_id), list(order.nodes[1:])
            self._pending = [(action.action_id, action.action_type) for action in first.actions]
            self.actions = []
            self._begun_s = self._work_s = None
        self.order, self.end = (order.order_id, order.update_id), order.nodes[-1]
        return None

    def step(self, now_s: float) -> None:
        """Stop if it was asked to, or drive and work."""
        if any(one.action_status is ActionStatus.RUNNING for one in self.instant):
            self._stop()
        elif self._pending:
            self._work_s = now_s if self._work_s is None else self._work_s
            if now_s >= self._work_s + 3.0:
                action_id, kind = self._pending.pop(0)
                self.worked.append((action_id, kind))
                self.actions.append(ActionState(action_id=action_id, action_status=ActionStatus.FINISHED))
                self._work_s = None
        elif self.ahead:
            self._begun_s = now_s if self._begun_s is None else self._begun_s
            if now_s >= self._begun_s + 2.0:
                node = self.ahead.pop(0)
                position = node.node_position
                assert position is not None
                self.last, self.point = (node.node_id, node.sequence_id), (position.x, position.y)
                self._begun_s = None

    def _open(self) -> list[ActionState]:
        """The actions that are not over: the first one runs."""
        statuses = [ActionStatus.RUNNING, *[ActionStatus.WAITING] * len(self._pending)]
        ids = [action_id for action_id, _ in self._pending]
        return [
            ActionState(action_id=one, action_status=status)
            for one, status in zip(ids, statuses, strict=False)
        ]

    def state(self) -> State:
        """What it reports."""
        self._headers += 1
        return State(
            header_id=self._headers,
            timestamp="2026-01-01T00:00:00.000Z",
            version="2.1.0",
            manufacturer="standard",
            serial_number=self.name,
            order_id=self.order[0],
            order_update_id=self.order[1],
            last_node_id=self.last[0],
            last_node_sequence_id=self.last[1],
            driving=bool(self.ahead),
            operating_mode=self.mode,
            node_states=tuple(
                NodeState(node_id=node.node_id, sequence_id=node.sequence_id, released=True)
                for node in self.ahead
            ),
            edge_states=(),
            action_states=(*self.instant, *self.actions, *self._open()),
            battery_state=BatteryState(battery_charge=80.0, charging=False),
            errors=self.errors,
            safety_state=SafetyState(e_stop=EStop.NONE, field_violation=False),
            agv_position=Position(
                x=self.point[0], y=self.point[1], theta=0.0, map_id="map", position_initialized=True
            ),
        )
