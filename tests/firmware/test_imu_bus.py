"""The IMU of the Duemilanove's image: woken when it answers, told from one that sleeps, its bus freed. In simavr.

The Tiva's is the same state machine on another bus, which no emulator has.
"""

import pytest

from tests.firmware.emulator import Emulated

READINGS = (16384, -16384, 1, -1, 1310, -655)


def readings(board: Emulated) -> set[tuple[int, ...]]:
    """The counts of all readings since `forget`, without their ages."""
    return {tuple(map(int, fields[:6])) for fields in board.fields("i")}


def listen(board: Emulated, seconds: float) -> set[tuple[int, ...]]:
    """The counts that come in so long, while the host keeps the mode."""
    board.forget()
    for _ in range(round(seconds / 0.5)):
        board.seal("s 0 0")
        board.run(0.5)
    return readings(board)


def started(**how: object) -> Emulated:
    """A board with an IMU that reads so, in the checked mode."""
    board = Emulated(imu=READINGS, **how)  # type: ignore[arg-type]
    board.hello(2000)
    return board


def test_an_imu_that_was_away_at_boot_is_woken_when_it_answers() -> None:
    """It is asleep when it is plugged in, and would read as zeros: none is told, and within half a second it reads."""
    board = started()
    board.board.set_imu(False)
    board.board.reset()
    board.run(0.1)
    board.hello(2000)
    assert listen(board, 0.5) == set()
    board.board.set_imu(True)
    assert listen(board, 0.5) == {READINGS}


def test_an_imu_that_was_unplugged_while_it_ran_is_woken_again() -> None:
    """No zeros and no old readings: nothing while it is away, then its own."""
    board = started()
    assert listen(board, 0.5) == {READINGS}
    board.board.set_imu(False)
    board.run(0.1)
    assert listen(board, 0.5) == set()
    board.board.set_imu(True)
    assert listen(board, 0.5) == {READINGS}


def test_an_imu_that_fell_asleep_is_told_from_one_that_rests() -> None:
    """A gap of its power that the bus does not show: zeros in all of it are no reading, and it is woken."""
    board = started()
    board.board.set_imu(False)
    board.board.set_imu(True)
    assert listen(board, 1.0) == {READINGS}


def test_an_imu_at_rest_with_zeros_is_read() -> None:
    """All six values 0, but not its temperature."""
    board = Emulated(imu=(0,) * 6)
    board.hello(2000)
    assert listen(board, 0.5) == {(0,) * 6}


@pytest.mark.parametrize("clocks", [1, 5, 9])
def test_a_reset_in_the_middle_of_a_reading_costs_no_imu(clocks: int) -> None:
    """It holds SDA low until its byte has been clocked out: the board does that at its start."""
    board = started()
    board.board.hold_sda(clocks)
    board.board.reset()
    board.run(0.1)
    assert "MPU6050 connection successful" in board.lines
    board.hello(2000)
    assert listen(board, 0.5) == {READINGS}


def test_a_bus_that_is_held_while_it_runs_is_freed() -> None:
    """A disturbance in a drive: the readings come back within half a second, and no cycle is late."""
    board = started()
    board.board.hold_sda(7)
    board.run(0.1)
    assert listen(board, 0.5) == {READINGS}
    listen(board, 1.0)
    assert int(board.fields("counters")[-1][5]) == 0


def test_a_bus_that_stays_held_costs_the_imu_alone() -> None:
    """SDA is shorted: no readings, 100 cycles a second, none of them late."""
    board = started()
    board.board.hold_sda(255)
    board.run(0.1)
    board.board.hold_sda(255)
    board.forget()
    for _ in range(5):
        board.board.hold_sda(255)
        board.seal("s 0 0")
        board.run(0.2)
    assert readings(board) == set()
    assert len(board.fields("t")) >= 99
    assert int(board.fields("counters")[-1][5]) == 0
