"""Whom a stop holds, and until when."""

import pytest

from chefbotd.safety import hold
from chefbotd.safety.hold import State

LET_GO_S = 1.0
ANN, BOB, CARL = 1, 2, 3


def tried(*tries: tuple[int, str, float], state: State = ()) -> State:
    """Commands of these clients for these sources at these times."""
    for client, source, now_s in tries:
        state = hold.record_attempt(state, source, client, now_s, LET_GO_S)
    return state


def test_who_goes_on_stays_held_and_who_lets_go_is_free() -> None:
    """Stopped at 10.02 s; a try each 50 ms, or 0.99 s after the last one, is held; after a second it is not."""
    state = hold.stop(tried((ANN, "teleop", 10.0)), BOB, "Bob", 10.02, LET_GO_S)
    for i in range(1, 101):
        state = tried((ANN, "teleop", 10.0 + i / 20), state=state)
        assert hold.holder_of(state, "teleop", ANN) == "Bob"
    assert hold.holder_of(tried((ANN, "teleop", 15.99), state=state), "teleop", ANN) == "Bob"
    assert hold.holder_of(tried((ANN, "teleop", 16.0), state=state), "teleop", ANN) == ""


@pytest.mark.parametrize(
    ("stopped_s", "by", "held"),
    [
        (10.0, CARL, ["navigation", "teleop"]),
        (10.0, BOB, ["navigation"]),
        (10.6, CARL, ["teleop"]),
        (11.3, CARL, []),
    ],
)
def test_held_is_what_others_drove_lately(stopped_s: float, by: int, held: list[str]) -> None:
    """Ann drove navigation last at 9.6 s, Bob teleop at 9.9 s, and nobody safety."""
    state = hold.stop(
        tried((BOB, "teleop", 9.9), (ANN, "navigation", 9.6)), by, "someone", stopped_s, LET_GO_S
    )
    assert sorted(s for s in ("teleop", "navigation", "safety") if hold.holder_of(state, s, ANN)) == held


def test_who_asks_anew_is_free_and_nobody_else() -> None:
    """Bob stops Ann and Carl; Carl asks anew, drives, and neither frees Ann nor keeps her held."""
    state = hold.stop(tried((ANN, "teleop", 9.9), (CARL, "teleop", 9.95)), BOB, "Bob", 10.0, LET_GO_S)
    state = hold.acknowledge(state, CARL)
    state = tried((CARL, "teleop", 10.1), (ANN, "teleop", 10.2), state=state)
    assert [hold.holder_of(state, "teleop", who) for who in (ANN, BOB, CARL)] == ["Bob", "", ""]
    state = tried((CARL, "teleop", 11.1), (ANN, "teleop", 11.2), state=state)
    assert hold.holder_of(state, "teleop", ANN) == ""


def test_a_stop_of_who_is_held_frees_nobody() -> None:
    """Ann is held by Bob's stop, and sends one herself: she must let go, or ask, as before."""
    state = hold.stop(tried((ANN, "teleop", 9.9), (CARL, "teleop", 9.9)), BOB, "Bob", 10.0, LET_GO_S)
    state = tried((ANN, "teleop", 10.2), state=hold.stop(state, ANN, "Ann", 10.1, LET_GO_S))
    assert hold.holder_of(state, "teleop", ANN) == "Ann"


def test_clients_that_know_of_a_stop_are_not_remembered_without_end() -> None:
    """Ten thousand that ask, on as many connections, during one stop."""
    state = hold.stop(tried((ANN, "teleop", 9.9)), BOB, "Bob", 10.0, LET_GO_S)
    for client in range(10, 10_010):
        state = hold.acknowledge(state, client)
    assert len(state[0].knowing) == hold.MOST_KNOWING
    assert hold.holder_of(state, "teleop", 10_009) == ""


def test_a_second_stop_frees_nobody_sooner() -> None:
    """Carl tries last at 10.4 s, then asks, and stops as well: Ann, who tried at 10.0 s, is held until 11.4 s."""
    state = tried((ANN, "teleop", 10.0), (CARL, "teleop", 10.1))
    state = tried((CARL, "teleop", 10.4), state=hold.stop(state, BOB, "Bob", 10.2, LET_GO_S))
    state = hold.stop(hold.acknowledge(state, CARL), CARL, "Carl", 10.9, LET_GO_S)
    assert hold.holder_of(tried((ANN, "teleop", 11.3), state=state), "teleop", ANN) == "Carl"
    assert hold.holder_of(tried((ANN, "teleop", 11.4), state=state), "teleop", ANN) == ""
