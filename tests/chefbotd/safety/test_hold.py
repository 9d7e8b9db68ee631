"""Which sources a stop holds, and until when."""

import pytest

from chefbotd.safety import hold
from chefbotd.safety.hold import Attempts

LET_GO_S = 1.0


def tried(*attempts: tuple[str, float], state: Attempts = ()) -> Attempts:
    """Commands from these sources at these times."""
    for source, now_s in attempts:
        state = hold.note_attempt(state, source, now_s, LET_GO_S)
    return state


def test_who_goes_on_stays_held_and_who_lets_go_is_free() -> None:
    """Stopped at 10.02 s; an attempt each 50 ms, or 0.99 s after the last one, is held; after a second it is not."""
    state = hold.hold(tried(("teleop", 10.0)), 10.02, LET_GO_S, "Bob")
    for i in range(1, 101):
        state = tried(("teleop", 10.0 + i / 20), state=state)
        assert hold.holder_of(state, "teleop") == "Bob"
    assert hold.holder_of(tried(("teleop", 15.99), state=state), "teleop") == "Bob"
    assert hold.holder_of(tried(("teleop", 16.0), state=state), "teleop") == ""


@pytest.mark.parametrize(
    ("stopped_s", "excluded", "held"),
    [
        (10.0, (), ["navigation", "teleop"]),
        (10.0, ("teleop",), ["navigation"]),
        (10.6, (), ["teleop"]),
        (11.3, (), []),
    ],
)
def test_held_is_what_was_driven_lately_and_is_not_excluded(
    stopped_s: float, excluded: tuple[str, ...], held: list[str]
) -> None:
    """Navigation was last driven at 9.6 s, teleop at 9.9 s, safety never."""
    state = hold.hold(
        tried(("teleop", 9.9), ("navigation", 9.6), state=()), stopped_s, LET_GO_S, "Bob", excluded
    )
    assert sorted(s for s in ("teleop", "navigation", "safety") if hold.holder_of(state, s)) == held


def test_who_asks_anew_is_free_and_nobody_else() -> None:
    """Two are held, one is freed and goes on."""
    state = hold.hold(tried(("teleop", 9.9), ("navigation", 9.8)), 10.0, LET_GO_S, "Bob")
    state = tried(("teleop", 10.1), ("navigation", 10.1), state=hold.free(state, ["navigation", "safety"]))
    assert (hold.holder_of(state, "teleop"), hold.holder_of(state, "navigation")) == ("Bob", "")
