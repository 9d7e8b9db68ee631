"""What this robot does when it is asked for an action: a row for each; and how an action's status goes on."""

from enum import StrEnum
from typing import Any, Final

from msgspec import Struct

from chefbot_vda5050.messages import Action, ActionStatus, BlockingType


class Scope(StrEnum):
    """Where an action may be asked for (6.15)."""

    INSTANT = "INSTANT"
    NODE = "NODE"


class Parameter(Struct, frozen=True):
    """A parameter of an action; ``kind`` is that of the factsheet."""

    key: str
    kind: str = "STRING"
    optional: bool = True
    description: str = ""


class Row(Struct, frozen=True):
    """An action that this robot can do."""

    scopes: tuple[Scope, ...]
    description: str
    parameters: tuple[Parameter, ...] = ()

    @property
    def blocking_types(self) -> tuple[BlockingType, ...]:
        """Of an instant action always NONE (6.2.1 of version 3.0)."""
        return tuple(BlockingType) if Scope.NODE in self.scopes else (BlockingType.NONE,)


LOAD: Final = tuple(
    Parameter(key)
    for key in ("stationType", "stationName", "loadType", "loadId", "lhd", "side", "height", "depth")
)
POSE: Final = (
    *(Parameter(key, "FLOAT", False) for key in ("x", "y", "theta")),
    Parameter("mapId", "STRING", False),
    Parameter("lastNodeId"),
)
OF_ACTION: Final = (Parameter("actionId", "STRING", False),)
NODE, INSTANT = (Scope.NODE,), (Scope.INSTANT,)

ACTIONS: Final = {
    "pick": Row(NODE, "asks people to load the robot, and waits for their answer", LOAD),
    "drop": Row(NODE, "asks people to take the load, and waits for their answer", LOAD),
    "waitForTrigger": Row(
        NODE,
        "waits for trigger, or until somebody answers on the robot's page",
        (Parameter("triggerType", "ARRAY", description="strings, or one string"),),
    ),
    "wait": Row(NODE, "waits for a time", (Parameter("duration", "FLOAT", False, "seconds, 0 to 3600"),)),
    "say": Row(
        (Scope.INSTANT, Scope.NODE),
        "says a sentence to people",
        (Parameter("text", "STRING", False, "at most 200 characters"),),
    ),
    "cancelOrder": Row(INSTANT, "stops where it is and deletes the order", (Parameter("orderId"),)),
    "startPause": Row(INSTANT, "stops where it is; the order can go on"),
    "stopPause": Row(INSTANT, "goes on with the order"),
    "stateRequest": Row(INSTANT, "sends the state"),
    "factsheetRequest": Row(INSTANT, "sends the factsheet"),
    "initPosition": Row(INSTANT, "tells the robot where it is", POSE),
    "clearInstantActions": Row(INSTANT, "forgets the instant actions that have ended"),
    "trigger": Row(INSTANT, "ends every waitForTrigger that runs"),
    "retry": Row(INSTANT, "tries an action again that has failed and is retriable", OF_ACTION),
    "skipRetry": Row(INSTANT, "gives such an action up", OF_ACTION),
}

NUMBERS: Final = ("FLOAT", "INTEGER", "NUMBER")
UNUSED: Final = ("lhd", "side", "height", "depth")
"""Parameters of pick and drop for what this robot has not: it has one place for a load and no lift."""

LONGEST_WAIT_S: Final = 3600.0
LONGEST_TEXT: Final = 200


def problem(action: Action, scope: Scope) -> str:
    """Why this robot cannot do this action there; empty: it can."""
    row = ACTIONS.get(action.action_type)
    if row is None:
        return f"this robot has no action {action.action_type!a}; it has: {', '.join(ACTIONS)}"
    if scope not in row.scopes:
        return f"{action.action_type} is for {' and '.join(row.scopes)}, and not for {scope}"
    known = {parameter.key: parameter for parameter in row.parameters}
    for parameter in action.action_parameters or ():
        if parameter.key not in known or parameter.key in UNUSED:
            return f"{action.action_type} has no parameter {parameter.key!a} on this robot"
    for key, expected in known.items():
        value = action.parameter(key)
        if value is None and not expected.optional:
            return f"{action.action_type} needs the parameter {key!a}"
        if value is not None and not _fits(value, expected.kind):
            return f"{action.action_type}: {key} is {value!a}, expected {expected.kind}"
    return _out_of_range(action)


def _fits(value: Any, kind: str) -> bool:
    if kind in NUMBERS:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if kind == "ARRAY" and isinstance(value, list):
        return all(isinstance(one, str) for one in value)
    return isinstance(value, str)


def _out_of_range(action: Action) -> str:
    if action.action_type == "wait" and not 0 <= action.parameter("duration") <= LONGEST_WAIT_S:
        return f"wait: duration is {action.parameter('duration')}, expected 0 to {LONGEST_WAIT_S:g} s"
    if action.action_type == "say":
        text = action.parameter("text")
        if not 0 < len(text) <= LONGEST_TEXT or not text.isprintable():
            return f"say: expected a text of 1 to {LONGEST_TEXT} printable characters"
    return ""


class Event(StrEnum):
    """What happens to an action."""

    START = "start"
    SUCCEED = "succeed"
    FAIL = "fail"
    CANCEL = "cancel"
    FAIL_FOR_NOW = "fail_for_now"


_STATUS = ActionStatus
NEXT: Final = {
    (_STATUS.WAITING, Event.START): _STATUS.RUNNING,
    (_STATUS.WAITING, Event.FAIL): _STATUS.FAILED,
    (_STATUS.WAITING, Event.CANCEL): _STATUS.FAILED,
    (_STATUS.RUNNING, Event.SUCCEED): _STATUS.FINISHED,
    (_STATUS.RUNNING, Event.FAIL): _STATUS.FAILED,
    (_STATUS.RUNNING, Event.CANCEL): _STATUS.FAILED,
    (_STATUS.RUNNING, Event.FAIL_FOR_NOW): _STATUS.RETRIABLE,
    (_STATUS.RETRIABLE, Event.START): _STATUS.RUNNING,
    (_STATUS.RETRIABLE, Event.FAIL): _STATUS.FAILED,
    (_STATUS.RETRIABLE, Event.CANCEL): _STATUS.FAILED,
}
"""6.11, and 6.6.9 of 3.0; a pair that is not here changes nothing. Nothing has to be prepared, or can be paused."""


class Tracked(Struct, frozen=True):
    """An action and how far it is; ``sequence_id`` is its node's, and None for an instant one."""

    action: Action
    status: ActionStatus
    sequence_id: int | None = None
    result: str | None = None

    def after(self, event: Event, result: str | None = None) -> "Tracked":
        """The same after an event."""
        status = NEXT.get((self.status, event))
        if status is None:
            return self
        return Tracked(self.action, status, self.sequence_id, result or self.result)
