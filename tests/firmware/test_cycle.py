"""The cycle: when it begins, what it does when it is late or the line is full, and clocks that wrap."""

import pytest

from tests.firmware import host, tools


def times(board: host.Board) -> list[int]:
    """The clock in each `t`."""
    return [int(body[1]) for body in board.bodies("t")]


@pytest.fixture
def checked(board: host.Board) -> host.Board:
    """A board in the checked mode."""
    board.hello()
    return board


def counters(board: host.Board) -> list[int]:
    """CRC, refused, overrun, gaps, dead-man, late: the newest line of them."""
    return [int(field) for field in board.bodies("counters")[-1][1:]]


def test_a_cycle_that_began_late_is_counted_and_moves_no_other(checked: host.Board) -> None:
    """From a millisecond on; the next cycles keep their grid, and the seconds are those since the one before."""
    for at_us in (10_000, 20_999, 31_000, 49_999, 50_000):
        checked.hold_up(at_us // 1000 - checked.fake.micros // 1000)
        checked.fake.micros = at_us
        checked.step()
    assert times(checked) == [10_000, 20_999, 31_000, 49_999, 50_000]
    assert [body[2] for body in checked.bodies("t")] == ["0.010", "0.011", "0.010", "0.019", "0.000"]
    checked.run(0.1)
    assert counters(checked)[5] == 2


def test_a_cycle_a_whole_period_late_begins_a_new_grid(checked: host.Board) -> None:
    """Missed cycles are not made up for."""
    checked.hold_up(35)
    checked.step()
    checked.run(0.02)
    assert times(checked) == [35_000, 45_000, 55_000]


def test_the_cycle_never_waits_for_the_line(checked: host.Board) -> None:
    """A host that reads nothing: the clock of the cycles goes on, whole lines are left out, none is cut."""
    checked.is_reading = False
    checked.run(1.0)
    data = checked.drain(4096)
    assert data.endswith(b"\n")
    assert len(data) > 255 - 90
    checked.is_reading = True
    checked.run(0.02)
    checked.raw = data + checked.raw
    assert times(checked)[-3:] == [30_000, 1_010_000, 1_020_000]
    numbers = [int(host.unsealed(line).split("\t")[-1]) for line in checked.sent]
    assert numbers == list(range(1, 1 + len(numbers)))


def test_a_change_that_found_no_room_is_told_later(checked: host.Board) -> None:
    """The e-stop came while the line was full."""
    checked.run(0.05)
    checked.is_reading = False
    checked.run(0.1)
    checked.write("estop")
    checked.run(0.03)
    checked.drain(4096)
    checked.is_reading = True
    checked.forget()
    checked.run(0.01)
    assert [body for body in checked.bodies("state") if body[2] == "2"] == [["state", "1", "2", "1", "1"]]


def test_the_ring_holds_the_banner_and_the_first_cycle() -> None:
    """Nothing of them is lost, however slow the line: the widest numbers, all readings."""
    tools.need("gcc", "make")
    board = host.Board(micros=4_294_900_000)
    board.measure(imu=(-32768,) * 6, battery=4095)
    board.is_reading = False
    board.start(host.POWER_ON)
    board.write("s -255 -255")
    board.run(0.02)
    kinds = [line.split(b"\t")[0] for line in board.drain(4096).split(b"\n")]
    assert kinds[3:10] == [b"firmware", b"t", b"e", b"u", b"s", b"i", b""]
    assert kinds[-2] == b"b"


@pytest.mark.parametrize("micros", [0, 4_294_967_296 - 150_000, 4_294_967_296 - 1, 2_147_483_648 - 100_000])
def test_the_clock_may_wrap_at_any_time(micros: int) -> None:
    """Cycles, dead-man, echo, return to the classic mode: all as from 0."""
    tools.need("gcc", "make")
    board = host.Board(micros=micros)
    board.hello(100)
    board.seal("s 40 41")
    board.run(0.099)
    assert board.duty == (40, 41)
    board.run(0.003)
    assert board.duty == (0, 0)
    board.run(0.1)
    assert times(board) == [(micros + 10_000 * number) % 2**32 for number in range(1, 21)]
    assert {body[2] for body in board.bodies("t")} == {"0.010"}
    assert board.fake.restarts == 0
    board.run(1.8)
    board.forget()
    board.run(0.02)
    assert board.sent[0].startswith("t\t")
    assert "*" not in board.sent[0]


def test_the_number_of_dead_man_stops_wraps_at_65536(board: host.Board) -> None:
    """Nothing else happens then; 65,537 stops are 1."""
    board.hello(50)
    for _ in range(65_537):
        board.seal("s 1 1")
        board.hold_up(50)
        board.is_reading = False
        board.step()
        board.drain(4096)
    board.is_reading = True
    board.forget()
    board.run(1.0)
    assert counters(board)[4] == 1
