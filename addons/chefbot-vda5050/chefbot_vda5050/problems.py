"""What is reported as an error: each reason with its name in each version, and what to do about it.

The reasons to refuse an order are those of 6.1.4 in version 3.0, which tells ten apart; version 2.1 (6.6.4) has fewer
names for them. Then come those to refuse an instant action, and what goes wrong with an order and with the robot.
"""

from collections.abc import Iterable
from enum import StrEnum
from typing import Final

from msgspec import Struct

from chefbot_vda5050 import versions
from chefbot_vda5050.messages import LONGEST_ID, Error, Level, Reference


class Reason(StrEnum):
    """Why something was refused, or what is wrong."""

    MALFORMED = "malformed"
    UNSUPPORTED_FIELD = "unsupported_field"
    UNSUPPORTED_ACTION = "unsupported_action"
    OUTDATED_UPDATE = "outdated_update"
    SAME_UPDATE = "same_update"
    OTHER_ORDER = "other_order"
    START_OUT_OF_RANGE = "start_out_of_range"
    NO_ROUTE = "no_route"
    NOT_AVAILABLE = "not_available"
    UNKNOWN_MAP = "unknown_map"
    NO_CONTINUATION = "no_continuation"
    CANCELLED_ORDER = "cancelled_order"
    TOO_LATE = "too_late"
    NO_ORDER_TO_CANCEL = "no_order_to_cancel"
    INSTANT_ACTION = "instant_action"
    DRIVE = "drive"
    ACTION = "action"
    UNREACHABLE = "unreachable"
    EMERGENCY_STOP = "emergency_stop"
    DISARMED = "disarmed"
    FAULT = "fault"
    NOT_LOCALIZED = "not_localized"


AFTER_STOP: Final = (
    "Look after the robot and arm it, then send stopPause, or press 'Go on' on the robot's page."
)


class Row(Struct, frozen=True):
    """A reason in each version, its section there, and what to do about it."""

    type_2_1: str
    section_2_1: str
    type_3_0: str
    section_3_0: str
    hint: str
    level_3_0: Level = Level.WARNING
    level_2_1: Level = Level.WARNING


ROWS: Final = {
    Reason.MALFORMED: Row(
        "validationError",
        "6.6.4.1",
        "VALIDATION_FAILURE",
        "6.1.4.1",
        "Correct the message as its schema and 6.6.1 of the standard say, and send it again.",
    ),
    Reason.UNSUPPORTED_FIELD: Row(
        "orderError",
        "6.6.4.2",
        "UNSUPPORTED_PARAMETER",
        "6.1.4.2",
        "Leave the fields out that are named here; the factsheet lists what this robot supports.",
        Level.CRITICAL,
    ),
    Reason.UNSUPPORTED_ACTION: Row(
        "orderError",
        "6.6.4.2",
        "INVALID_ORDER_ACTION",
        "6.1.4.3",
        "Send only actions, scopes and parameters that the factsheet lists.",
    ),
    Reason.OUTDATED_UPDATE: Row(
        "orderUpdateError",
        "6.6.4.3",
        "OUTDATED_ORDER_UPDATE",
        "6.1.4.4",
        "Continue from the orderUpdateId that the state reports.",
    ),
    Reason.SAME_UPDATE: Row(
        "orderUpdateError",
        "6.6.4.3",
        "SAME_ORDER_UPDATE_ID",
        "6.1.4.5",
        "Give another content another orderUpdateId.",
    ),
    Reason.OTHER_ORDER: Row(
        "orderError",
        "6.6.2",
        "OTHER_ORDER_ACTIVE",
        "6.1.4.6",
        "Wait for the end of the order that the state reports, or cancel it.",
    ),
    Reason.START_OUT_OF_RANGE: Row(
        "noRouteError",
        "6.6.1",
        "START_NODE_OUT_OF_RANGE",
        "6.1.4.7",
        "Begin the order at a node where the robot is, or with a larger allowedDeviationXY.",
    ),
    Reason.NO_ROUTE: Row(
        "noRouteError",
        "6.6.1",
        "NO_ROUTE_TO_TARGET",
        "6.1.4.8",
        "Look on the robot's map whether the node is in free space and nothing closes the way.",
    ),
    Reason.NOT_AVAILABLE: Row(
        "orderError",
        "6.10.6",
        "MOBILE_ROBOT_NOT_AVAILABLE",
        "6.1.4.9",
        "Send orders when operatingMode is AUTOMATIC; somebody at the robot has to end the other mode.",
    ),
    Reason.UNKNOWN_MAP: Row(
        "orderError",
        "6.7",
        "UNKNOWN_MAP_ID",
        "6.1.4.10",
        "Use the mapId that the state reports, or have the robot load the other map.",
    ),
    Reason.NO_CONTINUATION: Row(
        "orderUpdateError",
        "6.6.2",
        "INVALID_ORDER_UPDATE",
        "6.1.2",
        "Begin the update with the last node of the base, unchanged.",
    ),
    Reason.CANCELLED_ORDER: Row(
        "orderUpdateError",
        "6.6.3",
        "ORDER_UPDATE_FOLLOWING_CANCEL",
        "6.1.3.1",
        "Send a new order: the one of this orderId was cancelled.",
    ),
    Reason.TOO_LATE: Row(
        "orderError",
        "6.2",
        "OUTDATED_MESSAGE",
        "6.1",
        "Send it again; if all are too late, set the clocks of robot and manager by the same time server.",
    ),
    Reason.NO_ORDER_TO_CANCEL: Row(
        "noOrderToCancel",
        "6.6.3.2",
        "NO_ORDER_TO_CANCEL",
        "6.1.3.2",
        "Nothing needs to be done: the robot has no order.",
    ),
    Reason.INSTANT_ACTION: Row(
        "instantActionError",
        "6.9",
        "INVALID_INSTANT_ACTION",
        "6.2",
        "Send only instant actions and parameters that the factsheet lists.",
    ),
    Reason.DRIVE: Row(
        "driveError",
        "6.10.5",
        "NODE_UNREACHABLE",
        "6.6.5.4",
        "Look after the robot; it tries again by itself.",
        Level.CRITICAL,
    ),
    Reason.ACTION: Row(
        "actionError",
        "6.10.5",
        "ACTION_FAILED",
        "6.6.5.1",
        "Look after the action at the robot; then send it again or go on without it.",
    ),
    Reason.UNREACHABLE: Row(
        "robotUnreachable",
        "6.10.5",
        "ROBOT_UNREACHABLE",
        "6.6.5.1",
        "Look whether chefbotd runs on the robot (chefbotctl doctor).",
        Level.FATAL,
        Level.FATAL,
    ),
    Reason.EMERGENCY_STOP: Row(
        "emergencyStop",
        "6.10.5",
        "EMERGENCY_STOP",
        "6.6.5.1",
        "Look after the robot, then arm it (chefbotctl arm, or its page).",
        Level.FATAL,
        Level.FATAL,
    ),
    Reason.DISARMED: Row(
        "disarmed",
        "6.10.5",
        "DISARMED",
        "6.6.5.1",
        "Look after the robot, then arm it (chefbotctl arm, or its page).",
        Level.FATAL,
        Level.FATAL,
    ),
    Reason.FAULT: Row(
        "robotFault",
        "6.10.5",
        "ROBOT_FAULT",
        "6.6.5.1",
        "docs/safety.md says what the fault means; look after it, then arm the robot.",
        Level.FATAL,
        Level.FATAL,
    ),
    Reason.NOT_LOCALIZED: Row(
        "localizationError",
        "6.10.5",
        "LOCALIZATION_ERROR",
        "6.6.5.4",
        "Tell it where it is: initPosition, or on its page.",
        Level.FATAL,
    ),
}

LONGEST_TEXT, MOST_REFERENCES = 1000, 20
"""A state has to stay small, whatever somebody writes into an order."""

OF_ORDERS: Final = frozenset(list(Reason)[: list(Reason).index(Reason.NO_ORDER_TO_CANCEL)])
"""Refusals of orders: they are reported until an order is accepted."""


def names(reasons: Iterable[Reason], version: str) -> set[str]:
    """What this version calls them."""
    rows = [ROWS[reason] for reason in reasons]
    return {row.type_3_0 if versions.of(version) is versions.V3 else row.type_2_1 for row in rows}


class Problem(Struct, frozen=True):
    """A refusal or a failure: its sentence, and pairs of a key and a value that it is about.

    ``hint`` says what to do about it, where that is not what its reason's row says.
    """

    reason: Reason
    text: str
    references: tuple[tuple[str, str], ...] = ()
    hint: str = ""

    def error(self, version: str) -> Error:
        """As it is reported in the state of a version."""
        row, is_3 = ROWS[self.reason], versions.of(version) is versions.V3
        references = tuple(
            Reference(reference_key=key, reference_value=value[:LONGEST_ID])
            for key, value in self.references[:MOST_REFERENCES]
        )
        return Error(
            error_type=row.type_3_0 if is_3 else row.type_2_1,
            error_level=row.level_3_0 if is_3 else row.level_2_1,
            error_description=self.text[:LONGEST_TEXT],
            error_hint=self.hint or row.hint,
            error_references=references or None,
        )
