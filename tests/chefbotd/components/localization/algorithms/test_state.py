"""The table of localization's states: every pair of state and event, the pointless ones too."""

import pytest

from chefbotd.components.localization.algorithms.state import HAS_POSE, NEXT, PoseEvent, PoseState

STAYS = None
EXPECTED = {
    #                       unknown           searching         localized         uncertain          lost
    PoseEvent.POSE_GIVEN:     ("uncertain",       "uncertain",       "uncertain",       "uncertain",       "uncertain"),
    PoseEvent.SEARCH_STARTED: ("searching",      "searching",      "searching",      "searching",      "searching"),
    PoseEvent.FOUND:          (STAYS,            "localized",      STAYS,            STAYS,            STAYS),
    PoseEvent.NOT_FOUND:      (STAYS,            "lost",           STAYS,            STAYS,            STAYS),
    PoseEvent.FITS:           (STAYS,            STAYS,            STAYS,            "localized",      STAYS),
    PoseEvent.MISFITS:        (STAYS,            STAYS,            "uncertain",       STAYS,            STAYS),
    PoseEvent.GIVEN_UP:       (STAYS,            STAYS,            "lost",           "lost",           STAYS),
}  # fmt: skip
COLUMNS = ("unknown", "searching", "localized", "uncertain", "lost")


@pytest.mark.parametrize("event", list(PoseEvent))
@pytest.mark.parametrize("state", list(PoseState))
def test_every_pair_has_its_next_state(state: PoseState, event: PoseEvent) -> None:
    """What happens in each state is what the table in the documentation says."""
    expected = EXPECTED[event][COLUMNS.index(state)]
    assert NEXT[state, event] == (state if expected is STAYS else expected)


def test_only_a_search_or_a_person_ends_being_lost() -> None:
    """Scans that happen to fit do not make a lost robot sure of anything."""
    ways_out = {event for event in PoseEvent if NEXT[PoseState.LOST, event] is not PoseState.LOST}
    assert ways_out == {PoseEvent.POSE_GIVEN, PoseEvent.SEARCH_STARTED}
    assert PoseState.LOST not in HAS_POSE
