"""What stops the motors on the board: dead-man, hung main loop, watchdog, boot, e-stop, stall."""

import random
from collections.abc import Callable

import pytest

from tests.firmware import host

DEADMAN, ESTOP, STALL = 1, 2, 4


def state(board: host.Board) -> list[int]:
    """Mode, stops, e-stop and cause: the newest line of them."""
    return [int(field) for field in board.bodies("state")[-1][1:]]


@pytest.fixture
def checked(board: host.Board) -> host.Board:
    """A board in the checked mode with a dead-man of 250 ms."""
    board.hello()
    return board


# The dead-man


@pytest.mark.parametrize("deadman_ms", [50, 250, 2000])
def test_the_dead_man_stops_at_its_millisecond(board: host.Board, deadman_ms: int) -> None:
    """The duty is there until the last tick before the time is over, and 0 from the next one."""
    board.hello(deadman_ms)
    board.run(0.005)
    board.seal("s 100 -100")
    board.run(deadman_ms / 1000 - 0.001)
    assert board.duty == (100, -100)
    board.run(0.001)
    assert board.duty == (0, 0)


def test_the_dead_man_counts_from_the_lines_end_on_the_wire(checked: host.Board) -> None:
    """A main loop that reads late gains no time for the duty."""
    checked.receive(host.seal("s 100 -100 1").encode() + b"\r")
    checked.fake.micros += 9_000
    checked.step()
    checked.run(0.240)
    assert checked.duty == (100, -100)
    checked.run(0.001)
    assert checked.duty == (0, 0)


def test_a_line_that_is_read_after_its_time_moves_nothing(checked: host.Board) -> None:
    """What a hung main loop finds in its ring is too old to be obeyed; its stop is not."""
    checked.receive(host.seal("s 100 -100 1").encode() + b"\r")
    checked.fake.micros += 250_000
    checked.step()
    assert (checked.duty, checked.bodies("refused")) == ((0, 0), [])
    checked.seal("s 50 50")
    checked.receive(host.seal("s 0 0 3").encode() + b"\r")
    checked.fake.micros += 250_000
    checked.step()
    assert checked.duty == (0, 0)


def test_it_stays_stopped_until_the_next_command(checked: host.Board) -> None:
    """Not the old duty comes back, but the new one comes; the host is told of both."""
    checked.seal("s 100 -100")
    checked.run(0.3)
    assert state(checked) == [1, DEADMAN, 0, host.POWER_ON]
    checked.run(0.5)
    assert checked.duty == (0, 0)
    checked.seal("s 7 8")
    checked.run(0.02)
    assert (checked.duty, state(checked)) == ((7, 8), [1, 0, 0, host.POWER_ON])


@pytest.mark.parametrize("body", ["hello 1 250", "g 6 0", "arm 0", "x", "s 1", "s 99999 0", "w 1 1"])
def test_only_a_motion_feeds_it(checked: host.Board, body: str) -> None:
    """A hello, a parameter, a refused line: the host's control loop may be dead all the same."""
    checked.seal("s 100 -100")
    for _ in range(25):
        checked.run(0.01)
        checked.seal(body)
    checked.run(0.001)
    assert checked.duty == (0, 0)


def test_a_stop_without_a_seal_feeds_nothing_either(checked: host.Board) -> None:
    """It stops, and the dead-man goes on counting."""
    checked.run(0.2)
    checked.write("s 0 0")
    checked.run(0.06)
    assert state(checked)[1] == DEADMAN


def test_a_sealed_stop_feeds_it(checked: host.Board) -> None:
    """A host that keeps its robot still is alive."""
    for _ in range(10):
        checked.seal("s 0 0")
        checked.run(0.1)
    assert state(checked)[1] == 0


def test_the_duty_of_the_classic_mode_stops_too_once_it_is_negotiated(board: host.Board) -> None:
    """The dead-man counts from the hello."""
    board.write("s 90 90")
    board.hello(100)
    board.run(0.099)
    assert board.duty == (90, 90)
    board.run(0.001)
    assert board.duty == (0, 0)


def test_the_return_to_the_classic_mode_stops(board: host.Board) -> None:
    """With a dead-man of 2 s both come at once; no duty is left behind."""
    board.hello(2000)
    board.seal("s 90 90")
    board.run(2.0)
    assert board.duty == (0, 0)
    board.run(5.0)
    assert board.duty == (0, 0)


def test_the_dead_man_needs_no_main_loop(checked: host.Board) -> None:
    """The timer's interrupt alone stops the motors."""
    checked.seal("s 90 90")
    for _ in range(249):
        checked.fake.micros += 1000
        if checked.fake.restarts == 0:
            checked.tick()
    assert checked.duty == (0, 0)


@pytest.mark.parametrize(
    ("body", "newer"),
    [
        ("s 60 70", (60, 70)),
        ("w 3000 3000", (14, 14)),  # (1500 forward + 500 friction + 1500 proportional) / 256 = 13.7
        ("arm 0", (0, 0)),
        ("g 1 5", (0, 0)),
    ],
)
def test_a_dead_man_between_any_two_steps_of_the_main_loop_holds(
    checked: host.Board, body: str, newer: tuple[int, int]
) -> None:
    """The interrupt comes before each lock of the main loop in turn: afterwards no duty older than it is in force."""
    for lock in range(1, 12):
        board = host.Board()
        board.hello(50)
        for parameter, value in enumerate((1000, 500, 500, 500, 500)):
            board.seal(f"g {parameter} {value}")
        board.seal("s 100 -100")
        board.run(0.049)
        assert board.duty == (100, -100)
        board.receive(host.seal(f"{body} 9").encode() + b"\r")
        board.fake.tick_at_lock, board.fake.tick_micros = board.fake.locks + lock, board.fake.micros + 1000
        board.step()
        came = board.fake.tick_at_lock == 0
        assert came or lock > 1, "no lock at all"
        assert not came or board.duty in (newer, (0, 0)), f"before lock {lock}"
        assert board.fake.lock_errors == 0


# Main loop, watchdog, boot


def test_a_hung_main_loop_is_stopped_and_restarted(checked: host.Board) -> None:
    """200 ms without a complete cycle: motors off, restart by software, the cause named."""
    checked.hello(2000)
    checked.seal("s 90 90")
    checked.run(0.01)
    for _ in range(199):
        checked.fake.micros += 1000
        checked.tick()
    assert (checked.duty, checked.fake.restarts) == ((90, 90), 0)
    checked.fake.micros += 1000
    checked.tick()
    assert (checked.duty, checked.fake.restarts) == ((0, 0), 1)
    checked.start(host.SOFTWARE)
    assert checked.sent[-1] == "firmware\t1\t0\t1\t4\t31\t6"


def test_nothing_moves_after_a_restart_was_asked_for(checked: host.Board) -> None:
    """Until the program begins anew, neither loop nor tick does anything."""
    checked.seal("s 90 90")
    checked.watchdog()
    writes = checked.fake.motor_writes
    checked.seal("s 80 80")
    checked.run(0.5)
    assert (checked.duty, checked.fake.motor_writes, checked.fake.restarts) == ((0, 0), writes, 1)


def test_the_watchdogs_interrupt_names_its_cause(checked: host.Board) -> None:
    """Motors off, restart by software, cause 4."""
    checked.seal("s 90 90")
    checked.watchdog()
    assert (checked.duty, checked.fake.restarts) == ((0, 0), 1)
    checked.start(host.SOFTWARE)
    assert checked.sent[-1] == "firmware\t1\t0\t1\t4\t31\t4"


def test_a_complete_cycle_alone_feeds_the_watchdog(checked: host.Board) -> None:
    """A hundred cycles a second feed it a hundred times; passes without a cycle never."""
    assert checked.fake.has_watchdog
    before = checked.fake.feeds
    checked.run(1.0)
    assert checked.fake.feeds - before == 100
    for _ in range(1000):
        checked.step()
    assert checked.fake.feeds - before == 100


def test_a_dead_timer_lets_the_watchdog_bite(checked: host.Board) -> None:
    """Cycles without ticks between them do not feed it: without ticks there is no dead-man."""
    checked.run(0.1)
    before = checked.fake.feeds
    for _ in range(100):
        checked.fake.micros += 10_000
        checked.step()
    assert checked.fake.feeds - before <= 1  # of the tick before


@pytest.mark.parametrize("cause", [host.POWER_ON, host.PIN, host.BROWN_OUT, host.WATCHDOG])
def test_a_start_has_the_motors_off_and_names_its_cause(board: host.Board, cause: int) -> None:
    """Whatever the duty was before."""
    board.write("s 90 90")
    board.start(cause)
    assert board.duty == (0, 0)
    assert board.sent[-1] == f"firmware\t1\t0\t1\t4\t31\t{cause}"
    board.run(1.0)
    assert board.duty == (0, 0)


# The e-stop


def test_an_e_stop_latches_until_it_is_armed_with_its_number(checked: host.Board) -> None:
    """Refused with 4 until then; another number is refused with 6; the duty is 0 until the next command."""
    checked.seal("s 90 90")
    checked.write("estop")
    assert checked.duty == (0, 0)
    checked.forget()
    moved = checked.seal("s 50 50")
    wrong = [checked.seal(f"arm {number}") for number in (0, 2)]
    answers = [["refused", "4", str(moved)], *[["refused", "6", str(number)] for number in wrong]]
    assert (checked.duty, checked.bodies()) == ((0, 0), answers)
    checked.seal("arm 1")
    assert checked.duty == (0, 0)
    checked.seal("s 50 50")
    assert checked.duty == (50, 50)


def test_each_e_stop_raises_the_number(checked: host.Board) -> None:
    """An `arm` for an older one does not end a newer one."""
    checked.write("estop")
    checked.write("estop")
    checked.seal("estop")
    checked.run(0.01)
    assert state(checked) == [1, ESTOP, 3, host.POWER_ON]
    checked.seal("arm 2")
    checked.seal("s 50 50")
    assert checked.duty == (0, 0)
    checked.seal("arm 3")
    checked.seal("s 50 50")
    assert checked.duty == (50, 50)


@pytest.mark.parametrize("word", ["s 0 0", "sealed"])
def test_a_stop_is_not_refused_in_an_e_stop(checked: host.Board, word: str) -> None:
    """Nor does it end it."""
    checked.write("estop")
    checked.forget()
    if word == "sealed":
        checked.seal("s 0 0")
    else:
        checked.write(word)
    assert checked.sent == []
    checked.seal("s 5 5")
    assert checked.duty == (0, 0)


def test_the_wheel_loop_is_refused_in_an_e_stop_whether_set_up_or_not(checked: host.Board) -> None:
    """With 4: stopped comes before not set up."""
    checked.write("estop")
    checked.forget()
    number = checked.seal("w 1 1")
    assert checked.bodies() == [["refused", "4", str(number)]]


@pytest.mark.parametrize("cause", [host.SOFTWARE, host.PIN, host.BROWN_OUT, host.WATCHDOG])
def test_an_e_stop_holds_over_a_restart(checked: host.Board, cause: int) -> None:
    """Its number too, and in the classic mode as well; a sealed `arm` ends it there."""
    checked.write("estop")
    checked.write("estop")
    checked.start(cause)
    checked.write("s 50 50")
    assert checked.duty == (0, 0)
    checked.seal("arm 1")
    checked.write("s 50 50")
    assert checked.duty == (0, 0)
    checked.seal("arm 2")
    checked.write("s 50 50")
    assert checked.duty == (50, 50)


def test_an_armed_board_stays_armed_over_a_restart(checked: host.Board) -> None:
    """And its next e-stop has the next number."""
    checked.write("estop")
    checked.seal("arm 1")
    checked.start(host.PIN)
    checked.write("s 50 50")
    assert checked.duty == (50, 50)
    checked.write("estop")
    checked.hello()
    checked.run(0.01)
    assert state(checked)[1:3] == [ESTOP, 2]


def test_power_ends_an_e_stop(checked: host.Board) -> None:
    """What memory holds after the power comes on is nothing."""
    checked.write("estop")
    checked.start(host.POWER_ON)
    checked.write("s 50 50")
    assert checked.duty == (50, 50)


CAUSES = (host.SOFTWARE, host.PIN, host.BROWN_OUT, host.WATCHDOG)


@pytest.mark.parametrize("cause", CAUSES)
def test_damaged_memory_never_unlatches(board: host.Board, cause: int) -> None:
    """2,500 times one to a hundred flipped bits in what a restart keeps: the e-stop holds, and the cause is named."""
    luck = random.Random(cause)
    for _ in range(2_500):
        board.start(host.POWER_ON)
        board.write("estop")
        board.damage(*[luck.randrange(board.kept_bits) for _ in range(luck.randrange(1, 101))])
        board.start(cause)
        named = int(board.sent[-1].split("\t")[-1])
        board.write("s 50 50")
        assert board.duty == (0, 0)
        assert named in ((host.DAMAGED, host.POWER_ON) if cause == host.SOFTWARE else (cause,))


@pytest.mark.parametrize("cause", CAUSES)
def test_a_start_whose_note_does_not_check_is_stopped(board: host.Board, cause: int) -> None:
    """Each of the 56 bits of an armed board's note; a counter of letters and a byte of padding lie beside it."""
    stopped = 0
    for bit in range(board.kept_bits):
        board.start(host.POWER_ON)
        board.damage(bit)
        board.start(cause)
        board.write("s 50 50")
        stopped += board.duty == (0, 0)
    assert (stopped, board.kept_bits) == (56, 72)


def test_a_board_with_a_damaged_note_is_armed_by_its_number(board: host.Board) -> None:
    """The state says e-stop 1 and the cause; `arm 1` ends it."""
    board.damage(0, 9, 18)
    board.start(host.BROWN_OUT)
    board.hello()
    board.run(0.01)
    assert state(board) == [1, ESTOP, 1, host.BROWN_OUT]
    board.seal("arm 1")
    board.seal("s 50 50")
    assert board.duty == (50, 50)


def test_a_power_on_needs_no_note(board: host.Board) -> None:
    """Its memory holds anything: not stopped."""
    board.damage(*range(board.kept_bits))
    board.start(host.POWER_ON)
    board.write("s 50 50")
    assert board.duty == (50, 50)


# The stall


def stalled(board: host.Board, seconds: float, adc: int = 601) -> None:
    """Drive for so long with a current of so much on the right wheel."""
    for _ in range(round(seconds / 0.01)):
        board.measure(current={1: adc})
        board.seal("s 200 200")
        board.run(0.01)


def test_half_a_second_above_the_limit_is_a_stall(checked: host.Board) -> None:
    """50 cycles of 10 ms; then both motors stop, and a motion is refused with 4."""
    checked.seal("g 6 600")
    stalled(checked, 0.49)
    assert checked.duty == (200, 200)
    stalled(checked, 0.01)
    assert checked.duty == (0, 0)
    number = checked.seal("s 1 1")
    assert checked.bodies("refused") == [["refused", "4", str(number)]]
    assert state(checked) == [1, STALL, 0, host.POWER_ON]


@pytest.mark.parametrize(("limit", "adc"), [(0, 4095), (600, 600), (601, 600)])
def test_at_the_limit_and_without_one_there_is_no_stall(checked: host.Board, limit: int, adc: int) -> None:
    """0 is no limit."""
    checked.seal(f"g 6 {limit}")
    stalled(checked, 2.0, adc)
    assert checked.duty == (200, 200)


def test_a_moment_below_the_limit_begins_the_half_second_again(checked: host.Board) -> None:
    """Starting draws much current, too."""
    checked.seal("g 6 600")
    for _ in range(4):
        stalled(checked, 0.49)
        stalled(checked, 0.01, 10)
    assert checked.duty == (200, 200)


@pytest.mark.parametrize(
    "end",
    [
        lambda board: board.seal("arm 0"),
        lambda board: board.seal("s 0 0"),
        lambda board: board.write("s 0 0"),
    ],
)
def test_a_stop_or_arm_ends_a_stall(checked: host.Board, end: Callable[[host.Board], object]) -> None:
    """The next command moves the motors again."""
    checked.seal("g 6 600")
    stalled(checked, 0.5)
    end(checked)
    assert checked.duty == (0, 0)
    checked.seal("s 30 30")
    assert checked.duty == (30, 30)
