"""Which motor command answers which encoder frame."""

import pytest

from benchmarks.latency import answers_s


def test_a_frame_is_answered_by_the_first_command_after_it() -> None:
    """Frames at 1, 10 and 20 us, commands at 0.5, 4, 5 and 22 us: answers after 3, 12 and 2 us."""
    commands = [(500, (0, 0)), (4_000, (1, 1)), (5_000, (1, 1)), (22_000, (2, 2))]
    assert answers_s([1_000, 10_000, 20_000], commands) == pytest.approx([3e-6, 12e-6, 2e-6])


def test_a_frame_without_a_later_command_is_left_out() -> None:
    """Measuring may end between the two."""
    assert answers_s([1_000, 9_000], [(2_000, (1, 1))]) == pytest.approx([1e-6])
    assert answers_s([1_000], []) == []
