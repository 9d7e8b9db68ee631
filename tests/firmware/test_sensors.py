"""Readings never wait for one another, and each has its own age."""

import pytest

from tests.firmware import host


@pytest.fixture
def checked(board: host.Board) -> host.Board:
    """A board in the checked mode with a dead-man of 2 s."""
    board.hello(2000)
    return board


def echo(board: host.Board, after_s: float, width_s: float) -> None:
    """An echo of so long a pulse, so long after now."""
    board.run(after_s)
    board.echo(rising=True)
    board.run(width_s)
    board.echo(rising=False)


def test_the_ultrasonic_is_asked_20_times_a_second(board: host.Board) -> None:
    """Also where no echo comes; 50 ms after the start for the first time."""
    board.run(0.0499)
    assert board.fake.pings == 0
    board.run(1.0)
    assert board.fake.pings == 20


def test_an_echos_width_is_the_distance(checked: host.Board) -> None:
    """58 us a centimetre, rounded down: 8.7 ms are 150 cm; its age is that of its end."""
    checked.run(0.05)
    echo(checked, 0.001, 0.0087)
    checked.run(0.0303)
    assert checked.bodies("u") == [["u", "150", "30300"]]  # ended at 59.7, told at 90 ms


def test_no_echo_is_zero(checked: host.Board) -> None:
    """Known when the next one is asked for: at 100 ms, told at 140."""
    checked.run(0.14)
    assert checked.bodies("u") == [["u", "0", "40000"]]


def test_a_reading_is_told_once(checked: host.Board) -> None:
    """In the checked mode no old reading is repeated."""
    checked.measure(imu=(1, 2, 3, 4, 5, 6))
    checked.run(0.5)
    assert checked.bodies("i") == [["i", "1", "2", "3", "4", "5", "6", "20000"]]


def test_an_echo_that_does_not_end_is_no_echo_and_no_new_one_is_asked_for(board: host.Board) -> None:
    """A line that stays high: the sensor is not pinged until it falls."""
    board.run(0.05)
    board.echo(rising=True)
    board.run(0.3)
    assert board.fake.pings == 1
    board.echo(rising=False)
    board.run(0.05)
    assert board.fake.pings == 2


def test_a_fall_without_a_rise_is_no_echo(checked: host.Board) -> None:
    """The board started in the middle of one."""
    checked.run(0.06)
    checked.echo(rising=False)
    checked.run(0.08)
    assert checked.bodies("u") == [["u", "0", "40000"]]


def test_the_classic_wire_repeats_the_newest_distance(board: host.Board) -> None:
    """In each cycle, as the classic sketch does."""
    board.run(0.05)
    echo(board, 0.001, 0.0058)
    board.run(0.0032)
    board.forget()
    board.run(0.04)
    assert [line for line in board.sent if line[0] == "u"] == ["u\t100", "u\t100"]


def test_battery_and_currents_are_told_after_their_first_reading(checked: host.Board) -> None:
    """Not before: 0 would be a level."""
    checked.run(1.0)
    assert checked.bodies("a") == checked.bodies("b") == []
    checked.measure(battery=4095, current={1: 17})
    checked.run(1.0)
    assert checked.bodies("b") == [["b", "4095"]] * 5
    assert checked.bodies("a") == [["a", "1", "17"]] * 10
