"""Instant actions (6.9): the next state and what the robot is to do, as a function of values."""

from collections.abc import Callable
from typing import Final

from msgspec.structs import replace

from chefbot_vda5050 import actions
from chefbot_vda5050.actions import Event, Scope, Tracked
from chefbot_vda5050.messages import ENDED, Action, ActionStatus
from chefbot_vda5050.order import Step, changed, give_up, proceed
from chefbot_vda5050.problems import Problem, Reason
from chefbot_vda5050.vehicle import NEXT, Cancel, OrderEvent, Pause, Resume, Send, Start, Vehicle

MOST_RUNNING: Final = 16
KEPT: Final = 32
"""So many instant actions that have ended are reported at most."""


def instant_action(vehicle: Vehicle, action: Action) -> Step:
    """Somebody asks for an action at once; the same ``actionId`` a second time changes nothing."""
    if any(one.action.action_id == action.action_id for one in vehicle.actions):
        return vehicle, ()
    tracked = Tracked(action, ActionStatus.RUNNING)
    vehicle = replace(vehicle, actions=(*_not_too_many(vehicle.actions), tracked))
    if text := actions.problem(action, Scope.INSTANT):
        return _refused(vehicle, action, Problem(Reason.INSTANT_ACTION, text))
    vehicle = replace(vehicle, problems=vehicle.without(Reason.INSTANT_ACTION))
    if step := INSTANT.get(action.action_type):
        return step(vehicle, action)
    running = sum(one.sequence_id is None and one.status not in ENDED for one in vehicle.actions)
    if running > MOST_RUNNING:
        text = f"{MOST_RUNNING} instant actions run already"
        return _refused(vehicle, action, Problem(Reason.INSTANT_ACTION, text))
    return vehicle, (Start(action),)


def _cancel_order(vehicle: Vehicle, action: Action) -> Step:
    order_id = action.parameter("orderId")
    phase = NEXT.get((vehicle.phase, OrderEvent.CANCEL))
    if phase is None or order_id not in (None, vehicle.order_id):
        text = "the robot has no order" if phase is None else f"the robot's order is {vehicle.order_id!a}"
        return _refused(vehicle, action, Problem(Reason.NO_ORDER_TO_CANCEL, text))
    return give_up(vehicle, "the order was cancelled")


def _start_pause(vehicle: Vehicle, action: Action) -> Step:
    """The drive is given up and begun anew: a goal that is still being accepted could not be halted."""
    stopping = vehicle.stopping or vehicle.driving_to is not None
    return replace(vehicle, paused=True, stopping=stopping, driving_to=None), (Pause(action.action_id),)


def _stop_pause(vehicle: Vehicle, action: Action) -> Step:
    vehicle = changed(replace(vehicle, paused=False), action.action_id, Event.SUCCEED)
    vehicle, effects = proceed(vehicle)
    return vehicle, (Resume(), *effects)


def _send(what: str) -> Callable[[Vehicle, Action], Step]:
    def step(vehicle: Vehicle, action: Action) -> Step:
        return changed(vehicle, action.action_id, Event.SUCCEED), (Send(what),)

    return step


def _clear(vehicle: Vehicle, action: Action) -> Step:
    """Forget the instant actions that have ended, and this one is finished."""
    vehicle = changed(vehicle, action.action_id, Event.SUCCEED)
    kept = (one for one in vehicle.actions if one.sequence_id is not None or one.status not in ENDED)
    own = tuple(one for one in vehicle.actions if one.action is action)
    return replace(vehicle, actions=(*kept, *own)), ()


def _trigger(vehicle: Vehicle, action: Action) -> Step:
    """The manager says what actions wait for; people need not answer any more."""
    waiting = [one for one in vehicle.running() if one.action.action_type == "waitForTrigger"]
    if not waiting:
        return _refused(vehicle, action, Problem(Reason.INSTANT_ACTION, "no action waits for a trigger"))
    for one in waiting:
        vehicle = changed(vehicle, one.action.action_id, Event.SUCCEED, "the trigger came")
    vehicle, effects = proceed(changed(vehicle, action.action_id, Event.SUCCEED))
    return vehicle, (*(Cancel(one.action.action_id) for one in waiting), *effects)


def _retry(event: Event) -> Callable[[Vehicle, Action], Step]:
    def step(vehicle: Vehicle, action: Action) -> Step:
        number = action.parameter("actionId")
        failed = [
            one
            for one in vehicle.actions
            if one.action.action_id == number and one.status is ActionStatus.RETRIABLE
        ]
        if not failed:
            text = f"no action {number!a} can be tried again"
            return _refused(vehicle, action, Problem(Reason.INSTANT_ACTION, text))
        vehicle = changed(changed(vehicle, number, event), action.action_id, Event.SUCCEED)
        vehicle, effects = proceed(vehicle)
        begun = (Start(failed[0].action),) if event is Event.START else ()
        return vehicle, (*begun, *effects)

    return step


INSTANT: Final[dict[str, Callable[[Vehicle, Action], Step]]] = {
    "cancelOrder": _cancel_order,
    "startPause": _start_pause,
    "stopPause": _stop_pause,
    "stateRequest": _send("state"),
    "factsheetRequest": _send("factsheet"),
    "clearInstantActions": _clear,
    "trigger": _trigger,
    "retry": _retry(Event.START),
    "skipRetry": _retry(Event.FAIL),
}
"""The others are begun by ``Start``."""


def _refused(vehicle: Vehicle, action: Action, problem: Problem) -> Step:
    references = (("topic", "instantActions"), ("actionId", action.action_id))
    vehicle = vehicle.with_problem(replace(problem, references=references))
    return changed(vehicle, action.action_id, Event.FAIL, problem.text), ()


def _not_too_many(tracked: tuple[Tracked, ...]) -> tuple[Tracked, ...]:
    """Forget the oldest instant actions that have ended."""
    ended = [one for one in tracked if one.sequence_id is None and one.status in ENDED]
    forgotten = {one.action.action_id for one in ended[: max(0, len(ended) - KEPT + 1)]}
    return tuple(one for one in tracked if one.action.action_id not in forgotten)
