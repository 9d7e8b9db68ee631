"""What a wheel's turn counts, by ten turns of each wheel by hand."""

import pytest

from chefbotd.components.flash.turns import NOT_MEASURED, Turned, counts_in, judge_turns


def test_ten_turns_of_each_wheel_give_the_counts_and_say_what_they_rest_on() -> None:
    """84,010 and 83,990 in ten turns are 8400 a turn."""
    counts, advice = judge_turns([Turned((84_010, 3)), Turned((-2, 83_990))])
    assert counts == 8400
    assert "counts_per_turn = 8400" in advice
    assert "10 turns by hand counted 84010 on the left and 83990 on the right" in advice


def test_without_a_turn_nothing_is_multiplied() -> None:
    """The advice names no number to set, but says that four times an assumed one is assumed."""
    assert judge_turns([]) == (None, NOT_MEASURED)
    assert "four times an assumed figure is assumed too" in NOT_MEASURED


@pytest.mark.parametrize(
    ("left", "right", "words"),
    [
        ((0, 0), (0, 84_000), "left wheel's turns were not counted"),
        ((84_000, 0), (0, 4), "right wheel's turns were not counted"),
        ((0, 84_000), (84_000, 0), "exchange their plugs"),
        ((-84_000, 0), (0, 84_000), "counted backwards"),
        ((84_000, 0), (0, 75_600), "Was a turn missed?"),
    ],
)
def test_turns_that_do_not_add_up_give_no_figure(
    left: tuple[int, int], right: tuple[int, int], words: str
) -> None:
    """A dead encoder, exchanged plugs, a wrong sign, a turn that was missed."""
    counts, advice = judge_turns([Turned(left), Turned(right)])
    assert counts is None
    assert words in advice


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        (b"e\t12\t-7", (12, -7)),
        (b"e\t12\t-7\t200*1A2B", (12, -7)),
        (b"e\t12", None),
        (b"t\t1\t0.02", None),
        (b"e\tx\t1", None),
    ],
)
def test_counts_are_read_in_either_mode(line: bytes, counts: tuple[int, int] | None) -> None:
    """The classic line, and the checked one with its number behind."""
    assert counts_in(line) == counts
