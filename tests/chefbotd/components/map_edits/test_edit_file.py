"""The file of a map's edits: what counts, what was taken back, and what is no such file."""

from itertools import count

import pytest

from chefbotd.components.map_edits.edit_file import (
    LARGEST_BYTES,
    MOST_EDITS,
    MOST_STATES,
    NO_EDITS,
    DrawWall,
    Erase,
    MapEdit,
    MapEdits,
    parse_edits,
    step_back,
    step_forward,
    with_edit,
    with_view_angle,
    without_edit,
    write_edits,
)

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
ERASE, WALL = Erase(to="free", points_m=SQUARE), DrawWall(points_m=((0.0, 0.0), (1.0, 1.0)))


def test_what_is_written_is_read_again() -> None:
    """Edits in their order, and the view's angle; without a file there are none."""
    edits = with_view_angle(with_edit(with_edit(NO_EDITS, "a", ERASE), "b", WALL), 0.1)
    read = parse_edits(write_edits(edits))
    assert read == edits
    assert read.edits() == (("a", ERASE), ("b", WALL))
    assert read.state.view_angle_rad == 0.1
    assert parse_edits(None) == NO_EDITS


def test_changes_are_taken_back_one_by_one_and_made_again() -> None:
    """Also a deletion and a turn of the view; a new change gives up what was taken back."""
    edits, states = NO_EDITS, [NO_EDITS.state]
    for change in (
        lambda now: with_edit(now, "a", ERASE),
        lambda now: with_edit(now, "b", WALL),
        lambda now: without_edit(now, "a"),
        lambda now: with_view_angle(now, 0.2),
    ):
        edits = change(edits)
        states.append(edits.state)
    for state in reversed(states[:-1]):
        edits = step_back(edits)
        assert edits.state == state
    assert not edits.can_undo
    for state in states[1:]:
        edits = step_forward(edits)
        assert edits.state == state
    assert not edits.can_redo
    back = with_edit(step_back(step_back(edits)), "c", ERASE)
    assert not back.can_redo
    assert back.state.edits == ("a", "b", "c")


def test_only_the_last_states_are_remembered_and_no_edit_that_counts_is_forgotten() -> None:
    """Of many changes all that is drawn now, and what the last states had."""
    edits = NO_EDITS
    for number in range(2 * MOST_STATES):
        edits = with_edit(edits, str(number), WALL)
    for number in range(MOST_STATES):
        edits = without_edit(edits, str(number))
    assert len(edits.states) == MOST_STATES
    assert edits.state.edits == tuple(str(number) for number in range(MOST_STATES, 2 * MOST_STATES))
    back = edits
    while back.can_undo:
        back = step_back(back)
    assert back.state.edits == tuple(str(number) for number in range(1, 2 * MOST_STATES))


def draw_for_ever(edits: MapEdits, edit: MapEdit) -> None:
    """Draw this again and again."""
    for number in count(1000):
        edits = with_edit(edits, str(number), edit)


def test_too_many_edits_are_refused_and_too_large_a_file_forgets_old_states_first() -> None:
    """The 301st; and edits of 200 points each, whose file would be larger than is read."""
    edits = NO_EDITS
    for number in range(MOST_EDITS):
        edits = with_edit(edits, str(number), WALL)
    with pytest.raises(ValueError, match="a map has at most 300 edits"):
        with_edit(edits, "more", WALL)
    large = DrawWall(points_m=tuple((number + 0.1234, 0.1234) for number in range(200)))
    edits = NO_EDITS
    for number in range(54):
        edits = with_edit(edits, str(number), large)
    for number in range(200):
        edits = with_view_angle(edits, number / 1000)
        assert len(write_edits(edits)) <= LARGEST_BYTES
    assert 1 < len(edits.states) < MOST_STATES
    with pytest.raises(ValueError, match="too many points"):
        draw_for_ever(edits, large)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "edits.json: Invalid JSON"),
        (b"[]", "edits.json: "),
        (b'{"now": 1}', "now: expected one of 1 states, counted from 0, got 1"),
        (b'{"states": [{"edits": ["a"]}]}', "states: no edit with the id 'a' is drawn"),
        (b'{"drawn": {"a": {"kind": "erase", "points_m": [[0, 0], [1, 1], [0, 1]]}}}', "erase.to: Field required"),
        (b'{"drawn": {"a": {"kind": "hole"}}}', "drawn.a: "),
    ],
)  # fmt: skip
def test_what_holds_no_edits_is_refused_with_what_was_expected(content: bytes, problem: str) -> None:
    """And the file is named."""
    with pytest.raises(ValueError, match=r"^edits\.json") as refused:
        parse_edits(content)
    assert problem in str(refused.value)
