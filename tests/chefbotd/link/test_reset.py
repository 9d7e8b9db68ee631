"""A restart on request: what must have been seen before the board is asked."""

import pytest

from chefbotd.link.restarts import BACK_S, PLAY_COUNTS, STANDS_S, STOP_S, ResetRequest, ResetStage

COUNTS = (812, -355)


def stopped(request: ResetRequest, start_s: float) -> None:
    """The board says zero twice, and the wheels keep their counts for long enough."""
    request.counted(COUNTS, start_s)
    request.echoed((0.0, 0.0), start_s + 0.01)
    request.echoed((0.0, 0.0), start_s + 0.06)
    request.counted(COUNTS, start_s + STANDS_S)


def test_before_it_was_asked_for_nothing_is_asked() -> None:
    """Nor is the board overdue."""
    request = ResetRequest()
    assert not request.may_ask(1000.0)
    assert not request.is_overdue(1000.0)


def test_a_board_that_stands_and_says_so_twice_is_asked() -> None:
    """Zero in force, and the counts kept for 0.1 s: not a moment before."""
    request = ResetRequest()
    request.begin(0.0)
    request.counted(COUNTS, 0.0)
    request.echoed((0.0, 0.0), 0.01)
    request.echoed((0.0, 0.0), 0.06)
    request.counted(COUNTS, STANDS_S - 0.001)
    assert not request.may_ask(STANDS_S - 0.001)
    request.counted(COUNTS, STANDS_S)
    assert request.may_ask(STANDS_S)


def test_a_second_request_sees_for_itself() -> None:
    """What was seen for the first does not count: neither the echo nor the wheels that stood."""
    request = ResetRequest()
    request.begin(0.0)
    stopped(request, 0.0)
    assert request.may_ask(0.2)
    request.asked(0.2)
    assert request.stage is ResetStage.ASKED
    request.end()
    request.begin(10.0)
    assert not request.may_ask(10.0)
    request.echoed((0.0, 0.0), 10.01)
    request.echoed((0.0, 0.0), 10.06)
    assert not request.may_ask(10.06)
    request.counted(COUNTS, 10.25)
    assert not request.may_ask(10.25)
    request.counted(COUNTS, 10.36)
    assert request.may_ask(10.36)


def test_one_motor_that_is_driven_is_no_stop() -> None:
    """The echo (0, -40) begins it anew: two more of zero are needed."""
    request = ResetRequest()
    request.begin(0.0)
    request.counted(COUNTS, 0.0)
    request.counted(COUNTS, STANDS_S)
    for stamp_s, echo in [(0.11, (0.0, 0.0)), (0.16, (0.0, -40.0)), (0.21, (0.0, 0.0))]:
        request.echoed(echo, stamp_s)
        assert not request.may_ask(stamp_s)
    request.echoed((0.0, 0.0), 0.26)
    assert request.may_ask(0.26)


def test_two_echoes_of_one_read_are_one() -> None:
    """They share a stamp: the second may have been on its way as well."""
    request = ResetRequest()
    request.begin(0.0)
    request.counted(COUNTS, 0.0)
    request.counted(COUNTS, STANDS_S)
    request.echoed((0.0, 0.0), 0.2)
    request.echoed((0.0, 0.0), 0.2)
    assert not request.may_ask(0.2)


@pytest.mark.parametrize(("moved", "stands"), [(PLAY_COUNTS, True), (PLAY_COUNTS + 1, False)])
def test_an_encoder_that_dithers_stands(moved: int, stands: bool) -> None:
    """By three counts backwards on one wheel; by four it has rolled."""
    request = ResetRequest()
    request.begin(0.0)
    request.echoed((0.0, 0.0), 0.01)
    request.echoed((0.0, 0.0), 0.06)
    request.counted(COUNTS, 0.0)
    request.counted((COUNTS[0], COUNTS[1] - moved), STANDS_S)
    assert request.may_ask(STANDS_S) is stands


def test_a_board_that_never_says_zero_is_asked_in_the_end() -> None:
    """After 1.5 s; five seconds after that it is overdue, and each time is when to look again."""
    request = ResetRequest()
    request.begin(2.0)
    assert request.look_again_s == 2.0 + STOP_S
    assert not request.may_ask(2.0 + STOP_S - 0.001)
    assert request.may_ask(2.0 + STOP_S)
    request.asked(4.0)
    assert request.look_again_s == 4.0 + BACK_S
    assert not request.is_overdue(4.0 + BACK_S - 0.001)
    assert request.is_overdue(4.0 + BACK_S)
    assert not request.may_ask(100.0)
