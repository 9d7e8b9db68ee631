"""What the robot's side remembers of its order, and what it knows of its robot: values."""

import math
from enum import StrEnum
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from chefbot_vda5050.actions import Tracked
from chefbot_vda5050.messages import (
    ENDED,
    Action,
    ActionStatus,
    BlockingType,
    Edge,
    EStop,
    Load,
    Node,
    NodePosition,
    OperatingMode,
    Order,
)
from chefbot_vda5050.problems import Problem, Reason


class Phase(StrEnum):
    """How far the order is."""

    NONE = "none"
    ACTIVE = "active"
    FINISHED = "finished"
    CANCELLING = "cancelling"
    CANCELLED = "cancelled"


class OrderEvent(StrEnum):
    """What happens to the order."""

    NEW = "new"
    UPDATE = "update"
    CANCEL = "cancel"
    ALL_DONE = "all_done"
    ALL_STOPPED = "all_stopped"


NEXT: Final = {
    (Phase.NONE, OrderEvent.NEW): Phase.ACTIVE,
    (Phase.ACTIVE, OrderEvent.UPDATE): Phase.ACTIVE,
    (Phase.ACTIVE, OrderEvent.CANCEL): Phase.CANCELLING,
    (Phase.ACTIVE, OrderEvent.ALL_DONE): Phase.FINISHED,
    (Phase.FINISHED, OrderEvent.NEW): Phase.ACTIVE,
    (Phase.FINISHED, OrderEvent.UPDATE): Phase.ACTIVE,
    (Phase.CANCELLING, OrderEvent.ALL_STOPPED): Phase.CANCELLED,
    (Phase.CANCELLED, OrderEvent.NEW): Phase.ACTIVE,
}
"""6.6.2 and 6.6.3; a pair that is not here is refused."""


BLOCKS_DRIVING: Final = frozenset({BlockingType.SOFT, BlockingType.HARD})
ALONE: Final = frozenset({BlockingType.SINGLE, BlockingType.HARD})
"""6.12, and 6.2.2 of version 3.0."""

BEGUN: Final = frozenset({ActionStatus.RUNNING, ActionStatus.RETRIABLE})

FOR_ORDERS: Final = frozenset(
    {OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC, OperatingMode.INTERVENED}
)
CLEARING: Final = frozenset(OperatingMode) - FOR_ORDERS
"""Modes in which the robot takes no order, and deletes the one that it has (6.10.6)."""


class Vehicle(Struct, frozen=True):
    """The order of a robot: what is left of it, and what became of its actions.

    ``driving_to`` is the sequence number of the node that the robot was told to drive to. ``stopping``: it was told to
    stop, and does not stand yet. ``decision`` is the last node of the base, which an update has to begin with.
    """

    phase: Phase = Phase.NONE
    order: Order | None = None
    nodes: tuple[Node, ...] = ()
    edges: tuple[Edge, ...] = ()
    last_node_id: str = ""
    last_node_sequence_id: int = 0
    decision: Node | None = None
    actions: tuple[Tracked, ...] = ()
    problems: tuple[Problem, ...] = ()
    loads: tuple[Load, ...] = ()
    driving_to: int | None = None
    stopping: bool = False
    paused: bool = False

    @property
    def order_id(self) -> str:
        """Of the current or the last order; empty: there was none."""
        return self.order.order_id if self.order else ""

    @property
    def order_update_id(self) -> int:
        """Of the latest update that was accepted."""
        return self.order.order_update_id if self.order else 0

    @property
    def base(self) -> tuple[Node, ...]:
        """The released nodes that are left."""
        return tuple(node for node in self.nodes if node.released)

    def without(self, *reasons: Reason) -> tuple[Problem, ...]:
        """The problems but for those of these reasons."""
        return tuple(one for one in self.problems if one.reason not in reasons)

    def with_problem(self, problem: Problem) -> "Vehicle":
        """The same with a problem, in place of an earlier one of its reason."""
        return replace(self, problems=(*self.without(problem.reason), problem))

    def running(self) -> tuple[Tracked, ...]:
        """The actions of the order that have begun and not ended."""
        return tuple(one for one in self.actions if one.sequence_id is not None and one.status in BEGUN)

    def triggered(self) -> tuple[Tracked, ...]:
        """The actions of nodes that were reached and that have not begun, in their sequence."""
        left = {node.sequence_id for node in self.nodes}
        return tuple(
            one
            for one in self.actions
            if one.sequence_id is not None
            and one.status is ActionStatus.WAITING
            and one.sequence_id <= self.last_node_sequence_id
            and one.sequence_id not in left
        )

    def has_open_actions(self) -> bool:
        """Whether an action of the order has not ended."""
        return any(one.sequence_id is not None and one.status not in ENDED for one in self.actions)

    def may_drive(self) -> bool:
        """Whether no action keeps the robot where it is (6.12)."""
        blocking = (*self.running(), *self.triggered())
        return not any(one.action.blocking_type in BLOCKS_DRIVING for one in blocking)

    def next_node(self) -> Node | None:
        """The node to drive to; None: none is released."""
        return self.nodes[0] if self.nodes and self.nodes[0].released else None

    def max_speed_m_s(self, node: Node) -> float | None:
        """What the edge before a node allows; None: it does not say."""
        return next((one.max_speed for one in self.edges if one.sequence_id == node.sequence_id - 1), None)

    def needs_base(self) -> bool:
        """Whether the base runs low while there is a horizon (6.10.3)."""
        return self.phase is Phase.ACTIVE and len(self.base) <= 1 and len(self.nodes) > len(self.base)

    def passed_node(self) -> Node | None:
        """The node that is driven to, where the robot goes on without a stop; None: it stops there.

        Nothing is to be done at such a node, it has no heading, and the one behind it is released.
        """
        if self.driving_to is None or len(self.nodes) < 2 or not self.nodes[1].released:
            return None
        node, following = self.nodes[0], self.nodes[1]
        blocks = any(action.blocking_type in BLOCKS_DRIVING for action in node.actions)
        has_heading = node.node_position is None or node.node_position.theta is not None
        return None if blocks or has_heading or following.node_position is None else node


class Facts(Struct, frozen=True):
    """What is known of the robot now. Without a position it does not know where it is.

    ``speed_max_m_s`` and ``height_m`` are 0 where they are not known. ``missing`` says why the robot cannot drive.
    ``path`` is where it is going to drive: points in metres, on the map. ``stop_number`` changes with every stop,
    emergency stop and fault, also while the robot could not be reached; 0: it is not known.
    """

    connected: bool = False
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    localized: bool = False
    map_id: str = ""
    fit: float | None = None
    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    mode: OperatingMode = OperatingMode.AUTOMATIC
    e_stop: EStop = EStop.NONE
    held_back: bool = False
    armed: bool = True
    paused: bool = False
    charge_percent: float | None = None
    voltage_v: float | None = None
    fault: str = ""
    missing: str = ""
    path: tuple[tuple[float, float], ...] = ()
    stop_number: int = 0

    def distance_m(self, position: NodePosition) -> float:
        """From the robot to a node."""
        return math.hypot(position.x - self.x_m, position.y - self.y_m)

    def turn_rad(self, heading_rad: float) -> float:
        """How far the robot's heading is from this one."""
        return abs(math.remainder(heading_rad - self.heading_rad, math.tau))


LEAST_SPEED_M_S: Final = 0.05
"""Below it the wheels may not turn, or not evenly."""


class Limits(Struct, frozen=True):
    """What the robot is and how exact it has to be; from its configuration."""

    speed_max_m_s: float | None = None
    turn_max_rad_s: float | None = None
    height_m: float | None = None
    start_tolerance_m: float = 0.5
    passing_tolerance_m: float = 0.3
    heading_tolerance_rad: float = 0.2
    order_max_age_s: float = 10.0


# what the order's steps ask the robot for


class DriveTo(Struct, frozen=True):
    """Drive to a node, no faster than the edge before it allows."""

    node: Node
    max_speed_m_s: float | None = None


class Stop(Struct, frozen=True):
    """Give up the drive; ``order.stopped`` when the robot stands."""


class Pause(Struct, frozen=True):
    """Give up the drive for now; ``order.paused`` when the robot stands."""

    action_id: str


class Resume(Struct, frozen=True):
    """Go on, where somebody at the robot has halted it."""


class Start(Struct, frozen=True):
    """Begin an action; ``order.action_ended`` when it is over."""

    action: Action


class Cancel(Struct, frozen=True):
    """Give up an action that runs."""

    action_id: str


class Send(Struct, frozen=True):
    """Send the state or the factsheet now."""

    what: str


Effect = DriveTo | Stop | Pause | Resume | Start | Cancel | Send
