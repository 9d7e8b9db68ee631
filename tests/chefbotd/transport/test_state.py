"""Every state of a connection with every event."""

import pytest

from chefbotd.transport.state import NEXT, READING, SERVING, ConnectionEvent, ConnectionState

EXPECTED = """
             EOF          END       DRAIN_OVER   SERVED    CLOSE   LOST
OPEN         HALF_CLOSED  DRAINING  OPEN         OPEN      CLOSED  LOST
HALF_CLOSED  HALF_CLOSED  DRAINED   HALF_CLOSED  CLOSED    CLOSED  LOST
DRAINING     DRAINED      DRAINING  DRAINED      DRAINING  CLOSED  LOST
DRAINED      DRAINED      DRAINED   DRAINED      CLOSED    CLOSED  LOST
LOST         LOST         LOST      LOST         CLOSED    CLOSED  LOST
CLOSED       CLOSED       CLOSED    CLOSED       CLOSED    CLOSED  CLOSED
"""
HEADER, *ROWS = [line.split() for line in EXPECTED.strip().splitlines()]
PAIRS = [
    (ConnectionState[state], ConnectionEvent[event], ConnectionState[after])
    for state, *row in ROWS
    for event, after in zip(HEADER, row, strict=True)
]


@pytest.mark.parametrize(("state", "event", "after"), PAIRS)
def test_each_pair_leads_where_the_table_says(
    state: ConnectionState, event: ConnectionEvent, after: ConnectionState
) -> None:
    """An event that means nothing in a state, such as a second end, changes nothing."""
    assert NEXT[state, event] is after


def test_the_table_is_complete() -> None:
    """Six states times six events, and no more."""
    assert NEXT.keys() == {(state, event) for state in ConnectionState for event in ConnectionEvent}
    assert len(PAIRS) == len(NEXT) == 36


def test_a_connection_never_goes_back() -> None:
    """What is no longer read is never read again, nor is what is no longer served in order; closed is the end."""
    for (state, event), after in NEXT.items():
        assert state in READING or after not in READING, (state, event)
        assert state in SERVING or after not in SERVING, (state, event)
        assert state is not ConnectionState.CLOSED or after is ConnectionState.CLOSED


def test_every_state_ends_when_the_socket_is_lost_and_all_is_served() -> None:
    """From each state these two events lead to the end, so no connection stays behind."""
    for state in ConnectionState:
        assert NEXT[NEXT[state, ConnectionEvent.LOST], ConnectionEvent.SERVED] is ConnectionState.CLOSED
