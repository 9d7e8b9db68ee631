"""What the order asks of a robot: the interface, and how actions are done with it."""

import asyncio
from collections.abc import Callable
from typing import Final, Protocol

from msgspec import Struct

from chefbot_vda5050.messages import Action, Load, NodePosition
from chefbot_vda5050.vehicle import Facts

LOADED, TAKEN, CANNOT, GO_ON = "Loaded", "Taken", "It does not work", "Go on"
QUESTION_S: Final = 3600.0
"""A question is asked again after so long: whoever manages the robots decides when it is too late (6.8.1)."""


class DriveFailed(Exception):
    """The robot has not reached the node; ``by_people``: somebody at it has stopped it."""

    def __init__(self, reason: str, hint: str = "", *, by_people: bool = False) -> None:
        super().__init__(reason)
        self.reason, self.hint, self.by_people = reason, hint, by_people


class CannotDo(Exception):
    """The robot cannot do what it was asked for; the text says why."""


class Robot(Protocol):
    """A robot that drives freely on a map."""

    @property
    def facts(self) -> Facts:
        """What is known of it now."""

    def listen(self, changed: Callable[[], None], go_on: Callable[[], None]) -> None:
        """Have ``changed`` called after each change of the facts, and ``go_on`` when people press that button."""

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """Drive there, and no faster; a drive that is under way ends, without a stop where that is possible.

        Raises:
            DriveFailed: the robot has not reached it.
        """

    async def stop(self) -> None:
        """Give up every drive, and wait until the robot stands."""

    async def resume(self) -> None:
        """Go on, where somebody at the robot has halted it."""

    async def unreachable(self, position: NodePosition) -> str:
        """Why the robot cannot drive there on its map; empty: it can, or something that is not on it is in the way."""

    async def set_pose(self, position: NodePosition) -> None:
        """Tell the robot where it is; raises ``CannotDo``."""

    async def say(self, text: str) -> None:
        """Say a sentence to people; raises ``CannotDo``."""

    async def ask(self, question: str, choices: list[str], timeout_s: float) -> str | None:
        """Ask people; None: nobody has answered, and they are to be asked again. Raises ``CannotDo``."""


class Performed(Struct, frozen=True):
    """How an action ended: ``failed`` says why it failed, ``result`` what came of it."""

    failed: str = ""
    result: str | None = None
    load: Load | None = None


async def perform(robot: Robot, action: Action) -> Performed:
    """Do an action that was checked (``actions.problem``), to its end."""
    try:
        return await _perform(robot, action)
    except CannotDo as error:
        return Performed(failed=str(error))


async def _perform(robot: Robot, action: Action) -> Performed:
    match action.action_type:
        case "pick":
            return await _pick(robot, action)
        case "drop":
            where = _at(action)
            answer = await _ask(robot, f"Please take {_what(action)} from me{where}.", TAKEN)
            return Performed(failed="" if answer == TAKEN else "it was not taken", result=answer)
        case "waitForTrigger":
            await _ask(robot, f"I wait for {_trigger(action)}. Shall I go on?", GO_ON)
        case "wait":
            await asyncio.sleep(action.parameter("duration"))
        case "say":
            await robot.say(action.parameter("text"))
        case "initPosition":
            await _init_position(robot, action)
        case other:
            return Performed(failed=f"the robot does not know how to do {other}")
    return Performed()


async def _pick(robot: Robot, action: Action) -> Performed:
    answer = await _ask(robot, f"Please load {_what(action)} on me{_at(action)}.", LOADED)
    if answer != LOADED:
        return Performed(failed="it was not loaded", result=answer)
    load = Load(load_id=action.parameter("loadId"), load_type=action.parameter("loadType"))
    return Performed(result=answer, load=load)


async def _init_position(robot: Robot, action: Action) -> None:
    x, y, theta = (float(action.parameter(key)) for key in ("x", "y", "theta"))
    await robot.set_pose(NodePosition(x=x, y=y, theta=theta, map_id=action.parameter("mapId")))


async def _ask(robot: Robot, question: str, yes: str) -> str:
    """Ask until somebody answers; whoever waits may give up by cancelling the order."""
    choices = [yes] if yes == GO_ON else [yes, CANNOT]
    while True:
        answer = await robot.ask(question[:200], choices, QUESTION_S)
        if answer is not None:
            return answer


def _what(action: Action) -> str:
    words = (action.parameter("loadType"), action.parameter("loadId"))
    return " ".join(str(word) for word in words if word) or "the load"


def _trigger(action: Action) -> str:
    """Who or what triggers: in version 3.0 a list, with two names that mean something (6.2.3.1)."""
    named = action.parameter("triggerType") or []
    known = {"FLEET_CONTROL": "my fleet", "LOCAL": "you"}
    return " or ".join(known.get(one, one) for one in ([named] if isinstance(named, str) else named)) or "you"


def _at(action: Action) -> str:
    station = action.parameter("stationName")
    return f" at {station}" if station else ""
