"""Messages that come from the broker, judged by their form, whom they are for, and their age.

Whatever stops the robot is never too late: it does no harm, and clocks that disagree must not keep the robot driving.
"""

from collections.abc import Callable
from typing import Final

from chefbot_vda5050.freshness import Freshness, age_problem, judge_age
from chefbot_vda5050.messages import Action, Header, InstantActions, MalformedMessage, Order, decode
from chefbot_vda5050.problems import Problem, Reason
from chefbot_vda5050.topics import Kind, RobotName

STOPS: Final = frozenset({"cancelOrder", "startPause"})
"""Instant actions that count whatever their age, unless the broker has kept them (retained)."""


MOST_AT_ONCE: Final = 100
"""Of more instant actions in one message only those are begun that stop the robot."""


class Inbox:
    """The messages for one robot; ``version`` is the one that it speaks, ``max_age_s`` 0: any age will do."""

    def __init__(self, name: RobotName, version: str, max_age_s: float, clock: Callable[[], float]) -> None:
        self._name, self._version, self._max_age_s, self._clock = name, version, max_age_s, clock
        self._fresh: dict[Kind, Freshness] = {}

    def order(self, data: bytes, *, retained: bool = False) -> Order | Problem:
        """An order that has come in time."""
        try:
            order = decode(data, Order)
        except MalformedMessage as error:
            return _malformed(Kind.ORDER, error)
        return self._foreign(Kind.ORDER, order) or self._late(Kind.ORDER, order, retained=retained) or order

    def actions(self, data: bytes, *, retained: bool = False) -> tuple[tuple[Action, ...], Problem | None]:
        """The instant actions that are to be begun, and why others are not."""
        kind = Kind.INSTANT_ACTIONS
        try:
            message = decode(data, InstantActions)
        except MalformedMessage as error:
            return (), _malformed(kind, error)
        if (foreign := self._foreign(kind, message)) is not None:
            return (), foreign
        refused = self._late(kind, message, retained=retained)
        if refused is None and len(message.actions) > MOST_AT_ONCE:
            text = f"{len(message.actions)} instant actions in one message, expected at most {MOST_AT_ONCE}"
            refused = _about(Reason.MALFORMED, kind, text)
        if refused is None:
            return message.actions, None
        stops = () if retained else tuple(one for one in message.actions if one.action_type in STOPS)
        return stops, None if stops == message.actions else refused

    def late_by_now(self, order: Order) -> Problem | None:
        """Why an order is too late that has waited since it came; None: it is not."""
        why = age_problem(order, self._clock(), self._max_age_s)
        return _too_late(Kind.ORDER, why) if why else None

    def _foreign(self, kind: Kind, header: Header) -> Problem | None:
        if header.version.partition(".")[0] != self._version.partition(".")[0]:
            text = f"its version is {header.version}, and this robot speaks {self._version}"
            return _about(Reason.MALFORMED, kind, text)
        of = (header.manufacturer, header.serial_number)
        if of != (self._name.manufacturer, self._name.serial_number):
            return _about(Reason.MALFORMED, kind, f"it is for the robot {'/'.join(of)}")
        return None

    def _late(self, kind: Kind, header: Header, *, retained: bool) -> Problem | None:
        latest = self._fresh.get(kind, Freshness())
        self._fresh[kind], why = judge_age(latest, header, self._clock(), self._max_age_s, retained=retained)
        return _too_late(kind, why) if why else None


def _malformed(kind: Kind, error: MalformedMessage) -> Problem:
    return _about(Reason.MALFORMED, kind, f"the message on {kind} is malformed: {error}")


def _too_late(kind: Kind, why: str) -> Problem:
    return _about(Reason.TOO_LATE, kind, f"the message on {kind} is too late: {why}")


def _about(reason: Reason, kind: Kind, text: str) -> Problem:
    return Problem(reason, text, (("topic", str(kind)),))
