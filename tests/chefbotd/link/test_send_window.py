"""Which commands may follow those that the board may not have read, or does not confirm."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.link.send_window import STOP_AGAIN_S, STUCK_CYCLES, STUCK_S, Duty, SendWindow, slows
from tests.budget import examples

STILL = (0, 0)
AVR_BYTES = 63


def size_of(duty: Duty) -> int:
    """A command on the classic wire: ``s``, each number after a space, and CR."""
    return 2 + sum(1 + len(str(number)) for number in duty)


def window(room_bytes: int = AVR_BYTES) -> SendWindow:
    """The window of a two-wheeled robot."""
    return SendWindow(room_bytes, 2, size_of)


def write(into: SendWindow, duty: Duty, now_s: float) -> bool:
    """Write what may be written."""
    admitted = into.admit(duty, now_s)
    if admitted:
        into.note(duty, now_s)
    return admitted


def test_what_is_unread_is_counted_in_bytes():
    """``s 103 -199`` is 11 bytes. 12 are kept for stops, and a line for one that slows: three go, or two longer ones."""
    into = window()
    assert [write(into, (number, -199), 0.0) for number in range(103, 107)] == [True, True, True, False]
    assert into.unread_bytes == 33
    longer = window()
    assert [write(longer, (n, -1000), 0.0) for n in range(1003, 1007)] == [True, True, False, False]


def test_a_larger_buffer_takes_more():
    """1,024 bytes less 12 for stops and 11 for one that slows: 91 lines of 11 bytes."""
    into = window(1024)
    assert sum(write(into, (number, -199), 0.0) for number in range(103, 300)) == 91


def test_a_slowing_command_has_room_of_its_own_and_a_stop_always_goes():
    """Behind a full buffer: slower goes once, then only a stop, on any number of occasions."""
    into = window()
    for number in (103, 104, 105):
        assert write(into, (number, -199), 0.0)
    assert not into.admit((105, -200), 0.0)
    assert write(into, (105, -198), 0.0)
    assert not into.admit((104, -197), 0.0)
    assert write(into, STILL, 0.0)


def test_an_empty_buffer_takes_any_command():
    """Four wheels at full duty need more than is left beside the stops: one at a time goes all the same."""
    into = SendWindow(63, 4, size_of)
    assert write(into, (-1023, 1000, -1001, 1023), 0.0)
    assert not into.admit((-1023, 1001, -1001, 1023), 0.0)


def test_a_whole_cycle_proves_what_was_read():
    """Written between two cycles' lines it is read when the one after the next comes; sharing a read proves nothing."""
    into = window()
    into.cycle(0.0)
    into.note((103, -199), 0.01)
    into.cycle(0.02)
    assert into.unread_bytes == 11
    into.cycle(0.02)
    into.cycle(0.02)
    assert into.unread_bytes == 11
    into.cycle(0.04)
    assert into.unread_bytes == 0


def test_an_echo_that_moves_proves_what_was_read():
    """It comes to the second of three: one is unread."""
    into = window()
    into.echoed((0.0, 0.0))
    for number in (103, 104, 105):
        into.note((number, -199), 0.0)
    into.echoed((104.0, -199.0))
    assert into.unread_bytes == 11


def test_an_echo_of_something_else_proves_no_byte_read():
    """A piece that was obeyed says that something was lost, not that there is room."""
    into = window()
    into.echoed((0.0, 0.0))
    into.note((103, -199), 0.0)
    into.echoed((6637.0, 0.0))
    assert into.unread_bytes == 11


def test_an_echo_that_stands_still_proves_nothing():
    """The echo goes on saying the first of three: neither of the others was read by that."""
    into = window()
    into.note((103, -199), 0.0)
    into.echoed((103.0, -199.0))
    into.note((104, -199), 0.0)
    into.note((105, -199), 0.0)
    into.echoed((103.0, -199.0))
    assert into.unread_bytes == 22


def test_a_steady_command_does_not_fill_the_buffer():
    """Said again a thousand times to a board that reads nothing: room for a change is left, and nothing grows."""
    into = window()
    said = sum(write(into, (103, -199), 0.001 * number) for number in range(1000))
    assert said == 2
    assert write(into, (104, -199), 1.0)


def test_repeated_stops_do_not_fill_the_buffer():
    """A stop said again at 100 Hz to a board that is silent for 2 s: once, then ten a second, and nothing grows."""
    into = window()
    assert write(into, (103, -199), 0.0)
    times = [0.01 * number for number in range(1, 201)]
    said = [at_s for at_s in times if write(into, STILL, at_s)]
    assert said[0] == 0.01
    assert all(after - before >= STOP_AGAIN_S - 1e-9 for before, after in pairwise(said[1:]))
    assert 19 <= len(said) <= 21
    assert into.unread_bytes <= AVR_BYTES


def stuck() -> tuple[SendWindow, float]:
    """A board that has obeyed (50, -40), has been told (60, -45), and goes on for a while saying the former."""
    into = window()
    into.note((50, -40), 0.0)
    into.echoed((50.0, -40.0))
    into.note((60, -45), 0.0)
    for number in range(1, 21):
        into.cycle(number * 0.02)
        into.echoed((50.0, -40.0))
    return into, 0.4


@pytest.mark.parametrize(
    ("duty", "goes"),
    [
        ((61, -45), False),
        ((60, -46), False),
        ((-1, -45), False),
        ((60, 1), False),
        ((59, -45), True),
        ((60, -44), True),
        ((12, 0), True),
        (STILL, True),
    ],
)
def test_a_stuck_echo_holds_what_is_faster_and_nothing_that_slows(duty: Duty, goes: bool):
    """Held is what pushes any wheel harder than was said last, or the other way; all else goes at once."""
    into, now_s = stuck()
    assert into.echo_is_stuck(now_s)
    assert into.admit(duty, now_s) is goes


def test_a_stuck_echo_has_the_last_command_repeated_each_second():
    """It may have been lost on the wire: said again a second after it was said, not before."""
    into, _ = stuck()
    assert not into.admit((60, -45), 0.99)
    assert into.admit((60, -45), 1.0)


def test_a_lost_echo_is_a_stuck_one():
    """No ``s`` line comes any more, while the cycles go on: the same."""
    into = window()
    into.note((50, -40), 0.0)
    into.echoed((50.0, -40.0))
    into.note((60, -45), 0.0)
    for number in range(1, 21):
        into.cycle(number * 0.02)
    assert into.echo_is_stuck(0.4)


def test_an_echo_that_comes_late_is_not_stuck():
    """It takes three cycles and 0.2 s: a board that is silent meanwhile, or quick, is not suspected."""
    into = window()
    into.note((50, -40), 0.0)
    into.echoed((50.0, -40.0))
    into.note((60, -45), 0.0)
    for number in range(STUCK_CYCLES - 1):
        into.cycle(0.001 + number * 0.001)
    assert not into.echo_is_stuck(10.0)
    into.cycle(0.01)
    assert not into.echo_is_stuck(STUCK_S - 0.001)
    assert into.echo_is_stuck(STUCK_S)
    into.echoed((60.0, -45.0))
    assert not into.echo_is_stuck(10.0)


def test_an_echo_that_moves_along_is_not_stuck():
    """It is two commands behind and follows each: the board reads."""
    into = window(1024)
    into.note((50, -40), 0.0)
    into.echoed((50.0, -40.0))
    for number in range(1, 50):
        into.note((50 + number, -40), number * 0.1)
        into.cycle(number * 0.1)
        if number > 2:
            into.echoed((48.0 + number, -40.0))
        assert not into.echo_is_stuck(number * 0.1)


def test_an_echo_that_never_follows_is_no_echo():
    """Another firmware says metres a second: nothing is held for that."""
    into = window(1024)
    for number in range(1, 50):
        into.note((number, -40), number * 0.1)
        into.cycle(number * 0.1)
        into.echoed((0.25, -0.2))
    assert not into.echo_is_stuck(10.0)


def test_an_echo_of_stops_alone_has_not_followed():
    """A board that says ``s 0 0`` for ever was right about the stops: that is no proof that it echoes."""
    into = window(1024)
    into.note(STILL, 0.0)
    into.echoed((0.0, 0.0))
    for number in range(1, 50):
        into.note((number, -40), number * 0.1)
        into.cycle(number * 0.1)
        into.echoed((0.0, 0.0))
    assert not into.echo_is_stuck(10.0)


@pytest.mark.parametrize("end", ["forget", "restarted"])
def test_another_port_and_another_run_of_the_board_begin_anew(end: str):
    """Nothing of what was written before is waited for."""
    into, now_s = stuck()
    getattr(into, end)()
    assert into.unread_bytes == 0
    assert not into.echo_is_stuck(now_s)
    assert [write(into, (n, -199), now_s) for n in range(103, 107)] == [True, True, True, False]


@pytest.mark.parametrize(
    ("duty", "before", "expected"),
    [
        ((50, -40), (50, -40), True),
        ((0, -40), (50, -40), True),
        ((50, -41), (50, -40), False),
        ((-50, -40), (50, -40), False),
        ((0, 1), (50, 0), False),
    ],
)
def test_what_slows(duty: Duty, before: Duty, expected: bool):
    """Every wheel is pushed no harder than before, and none the other way."""
    assert slows(duty, before) is expected


@settings(max_examples=examples(100))
@given(st.lists(st.tuples(st.integers(-1023, 1023), st.integers(-1023, 1023)), max_size=300))
def test_motion_never_overflows_the_buffer_of_a_board_that_does_not_read(asked: list[Duty]):
    """Whatever is asked, every motion fits whole into what is left of 63 bytes; only stops may not."""
    into, held = window(), 0
    for number, duty in enumerate(asked):
        if into.admit(duty, 0.001 * number):
            into.note(duty, 0.001 * number)
            held += size_of(duty)
            assert held <= AVR_BYTES or not any(duty)
        held = min(held, AVR_BYTES)


def test_a_wheel_that_is_told_to_stand_makes_no_stop():
    """A full buffer holds (0, -1000) as any motion, and an echo of (50, 0) is one that follows."""
    into = window()
    for number in (103, 104, 105):
        assert write(into, (number, -199), 0.0)
    assert not into.admit((0, -1000), 0.0)
    into = window()
    into.note((50, 0), 0.0)
    into.echoed((50.0, 0.0))
    into.note((60, 0), 0.0)
    for number in range(1, 21):
        into.cycle(number * 0.02)
    assert into.echo_is_stuck(0.4)


def test_before_the_first_command_a_stop_was_said():
    """On a new port and after a restart: nobody may count on a motion that was said before."""
    into = window()
    assert into.memory.newest == STILL
    into.note((50, -40), 0.0)
    into.restarted()
    assert into.memory.newest == STILL


def test_a_stop_is_said_again_at_once_while_a_quarter_of_the_buffer_is_not_in_use():
    """Of 50 bytes a stop takes 6: with a second one 12 are in use (4 x 12 < 50), with a third 18 would be."""
    into = window(50)
    assert write(into, STILL, 0.0)
    assert write(into, STILL, 0.0)
    assert not into.admit(STILL, STOP_AGAIN_S - 0.001)
    assert into.admit(STILL, STOP_AGAIN_S)


def test_a_stop_that_may_not_fit_makes_the_last_line_as_new_as_itself():
    """9 and 6 of 20 bytes were written before a cycle, 6 more after it: the next one proves only the first line read."""
    into = window(20)
    into.note((10, -20), 0.0)
    into.note(STILL, 0.0)
    into.cycle(0.01)
    into.note(STILL, 0.02)
    assert into.unread_bytes == 15
    into.cycle(0.03)
    assert into.unread_bytes == 6


def test_an_echo_that_stops_two_commands_behind_is_stuck():
    """It confirms the first of three and no more: the second is what is waited for."""
    into = window()
    for number in (50, 60, 70):
        into.note((number, -40), 0.0)
    into.echoed((50.0, -40.0))
    for number in range(1, 21):
        into.cycle(number * 0.02)
        into.echoed((50.0, -40.0))
    assert into.echo_is_stuck(0.4)


def test_an_echo_that_goes_on_changing_is_not_stuck():
    """It has followed once, and shows pieces of commands since: the board reads, whatever it makes of it."""
    into = window()
    into.note((50, -40), 0.0)
    into.echoed((50.0, -40.0))
    into.note((60, -45), 0.0)
    for number in range(1, 21):
        into.cycle(number * 0.02)
        into.echoed((6.0 + number, -40.0))
    assert not into.echo_is_stuck(0.4)


def test_the_newest_command_is_confirmed_however_many_were_said_before_it():
    """Of a hundred in a row the board shows the last: it follows, so the next one that it does not show is missed."""
    into = window(100_000)
    for number in range(1, 101):
        into.note((number, -40), 0.001 * number)
    into.echoed((100.0, -40.0))
    into.note((101, -40), 1.0)
    for number in range(1, 21):
        into.cycle(1.0 + number * 0.02)
        into.echoed((100.0, -40.0))
    assert into.echo_is_stuck(1.4)
