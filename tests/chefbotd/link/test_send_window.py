"""What a board that has stopped reading may be given."""

from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.link.unread import LINE_LOST_S, MOST_UNREAD, UnreadCommands

STILL = (0, 0)


def filled(unread: UnreadCommands, now_s: float = 0.0) -> None:
    """Write as many different commands as may be unread: (1, 1) to (10, 10)."""
    for number in range(1, MOST_UNREAD + 1):
        assert unread.admit((number, number), now_s)
        unread.note((number, number), now_s)


def test_motion_that_nobody_reads_is_bounded_and_a_stop_is_not():
    """Ten commands go, the eleventh does not, a stop does at any time; a second later one more goes."""
    unread = UnreadCommands()
    filled(unread)
    assert not unread.admit((11, 11), 0.1)
    assert unread.admit(STILL, 0.1)
    assert not unread.admit((11, 11), LINE_LOST_S - 0.001)
    assert unread.admit((11, 11), LINE_LOST_S)


def test_an_echo_that_moves_proves_what_was_read():
    """The echo comes to the fourth of ten: six are unread, so four more may go, then none."""
    unread = UnreadCommands()
    unread.echoed((0.0, 0.0))
    filled(unread)
    unread.echoed((4.0, 4.0))
    for number in range(11, 15):
        assert unread.admit((number, number), 0.1)
        unread.note((number, number), 0.1)
    assert not unread.admit((15, 15), 0.1)


def test_an_echo_that_stands_still_proves_nothing():
    """The board talks on, and its echo, which has followed a command before, does not move: motion is held."""
    unread = UnreadCommands()
    unread.note((-5, 5), 0.0)
    unread.echoed((-5.0, 5.0))
    filled(unread)
    unread.heard()
    unread.echoed((-5.0, 5.0))
    assert not unread.admit((11, 11), 0.1)


def test_an_echo_that_never_follows_is_no_echo():
    """Another firmware says `s 0 0` whatever it does: nothing can be learned from that, so talking counts."""
    unread = UnreadCommands()
    for _ in range(5):
        unread.heard()
        unread.echoed((0.0, 0.0))
        filled(unread)


def test_an_echo_of_something_else_proves_all():
    """A board that clamps says what nobody sent; it has been reading all the same."""
    unread = UnreadCommands()
    unread.echoed((0.0, 0.0))
    filled(unread)
    unread.echoed((255.0, 255.0))
    filled(unread)


def test_a_board_without_echoes_proves_by_talking():
    """A lean board only sends `t` and `e`: whatever it says counts."""
    unread = UnreadCommands()
    filled(unread)
    unread.heard()
    assert unread.admit((11, 11), 0.1)


def test_after_a_steady_command_a_change_goes_at_once():
    """Whether repetitions were read cannot be told; the echo says they are in force, so they and another go."""
    unread = UnreadCommands()
    for _ in range(MOST_UNREAD):
        unread.note((5, 5), 0.0)
        unread.echoed((5.0, 5.0))
    unread.note((5, 5), 0.0)
    assert unread.admit((5, 5), 0.1)
    assert unread.admit((6, 6), 0.1)
    unread.note((6, 6), 0.1)
    assert not unread.admit((7, 7), 0.1)
    unread.echoed((6.0, 6.0))
    assert unread.admit((7, 7), 0.1)


def test_another_port_begins_anew():
    """What the old port was given is of no concern to the next."""
    unread = UnreadCommands()
    filled(unread)
    unread.forget()
    filled(unread)


@settings(max_examples=100)
@given(st.lists(st.integers(-2, 2), max_size=400))
def test_a_board_that_never_reads_gets_eleven_motions_whatever_is_asked(asked: list[int]):
    """Its echo stands still for a second: ten motions other than the one in force, and one more after that."""
    unread, motions = UnreadCommands(), 0
    unread.echoed((1.0, 1.0))
    for number in asked:
        duty = (number, number)
        if unread.admit(duty, 0.0):
            unread.note(duty, 0.0)
            motions += number not in (0, 1)
        unread.echoed((1.0, 1.0))
    assert motions <= MOST_UNREAD + 1
