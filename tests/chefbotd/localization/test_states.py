"""The table of localization's states: every pair of state and event, the pointless ones too."""

import pytest

from chefbotd.localization.states import HAS_POSE, NEXT, Event, State

STAYS = None
EXPECTED = {
    #                       unknown           searching         localized         uncertain          lost
    Event.POSE_GIVEN:     ("uncertain",       "uncertain",       "uncertain",       "uncertain",       "uncertain"),
    Event.SEARCH_STARTED: ("searching",      "searching",      "searching",      "searching",      "searching"),
    Event.FOUND:          (STAYS,            "localized",      STAYS,            STAYS,            STAYS),
    Event.NOT_FOUND:      (STAYS,            "lost",           STAYS,            STAYS,            STAYS),
    Event.FITS:           (STAYS,            STAYS,            STAYS,            "localized",      STAYS),
    Event.MISFITS:        (STAYS,            STAYS,            "uncertain",       STAYS,            STAYS),
    Event.GIVEN_UP:       (STAYS,            STAYS,            "lost",           "lost",           STAYS),
}  # fmt: skip
COLUMNS = ("unknown", "searching", "localized", "uncertain", "lost")


@pytest.mark.parametrize("event", list(Event))
@pytest.mark.parametrize("state", list(State))
def test_every_pair_has_its_next_state(state: State, event: Event) -> None:
    """What happens in each state is what the table in the documentation says."""
    expected = EXPECTED[event][COLUMNS.index(state)]
    assert NEXT[state, event] == (state if expected is STAYS else expected)


def test_only_a_search_or_a_person_ends_being_lost() -> None:
    """Scans that happen to fit do not make a lost robot sure of anything."""
    ways_out = {event for event in Event if NEXT[State.LOST, event] is not State.LOST}
    assert ways_out == {Event.POSE_GIVEN, Event.SEARCH_STARTED}
    assert State.LOST not in HAS_POSE
