"""The states of a goal, and what is tried when the robot cannot go on."""

import itertools

import pytest

from chefbotd.components.navigation.algorithms.recovery import (
    ORDER,
    Action,
    Recovery,
    after,
    is_over,
    start_recovery,
)
from chefbotd.components.navigation.algorithms.states import NEXT, GoalEvent, GoalState, next_state

ENDED, REPLACED = {"goal_ended": "idle"}, {"goal_replaced": "planning"}
ALLOWED = {
    "idle": {"goal_accepted": "planning"},
    "planning": {"path_found": "driving", "stuck": "recovering", "paused": "paused", **REPLACED, **ENDED},
    "driving": {"path_found": "driving", "stuck": "recovering", "paused": "paused", **REPLACED, **ENDED},
    "recovering": {"path_found": "driving", "paused": "paused", **REPLACED, **ENDED},
    "paused": {"resumed": "planning", **REPLACED, **ENDED},
}


@pytest.mark.parametrize(("state", "event"), list(itertools.product(GoalState, GoalEvent)))
def test_each_pair_of_state_and_event_leads_on_or_is_refused(state: GoalState, event: GoalEvent) -> None:
    """What leads on leads to the state of the table above; all else is a bug, and raises."""
    expected = ALLOWED[state].get(event)
    if expected is None:
        with pytest.raises(ValueError, match=f"{state} with {event}"):
            next_state(state, event)
    else:
        assert next_state(state, event) == expected


def test_every_state_is_left_by_an_end_but_idle() -> None:
    """A goal can end whatever the robot does."""
    assert {state for state, event in NEXT if event is GoalEvent.GOAL_ENDED} == set(GoalState) - {
        GoalState.IDLE
    }


def test_what_is_tried_comes_in_order_and_has_an_end() -> None:
    """Looks, backs out, tries another way, waits, asks, and gives up."""
    tried, recovery = [], start_recovery(None, 3.0, 5.0)
    while recovery is not None:
        tried.append(recovery.action)
        recovery = after(recovery, 4.0)
    assert tuple(tried) == ORDER == (Action.LOOK, Action.BACK_OUT, Action.OTHER_WAY, Action.WAIT, Action.ASK)


def test_who_is_stuck_again_at_once_tries_the_next_thing() -> None:
    """0.5 m nearer is the same trouble, 0.7 m nearer another one."""
    last = Recovery(Action.BACK_OUT, 10.0, 8.0, left_m=4.0)
    assert start_recovery(last, 20.0, 3.5) == Recovery(Action.OTHER_WAY, 20.0, 8.0, 4.0)
    assert start_recovery(last, 20.0, 3.3) == Recovery(Action.LOOK, 20.0, 20.0, 3.3)


def test_where_people_go_to_and_fro_it_is_patient_for_a_minute() -> None:
    """Everything was tried within 12 s: it waits again; after 61 s it is the end."""
    asked = Recovery(Action.ASK, 10.0, 8.0, 4.0)
    assert start_recovery(asked, 20.0, 3.9) == Recovery(Action.WAIT, 20.0, 8.0, 4.0)
    assert start_recovery(asked, 69.0, 3.9) is None


@pytest.mark.parametrize(("rung", "lasts_s"), [(Action.LOOK, 1.0), (Action.WAIT, 12.0), (Action.ASK, 12.0)])
def test_each_has_its_time(rung: Action, lasts_s: float) -> None:
    """Over when it has had it, and not before."""
    recovery = Recovery(rung, 100.0, 90.0, 4.0)
    assert not is_over(recovery, 100.0 + lasts_s - 0.01)
    assert is_over(recovery, 100.0 + lasts_s)
