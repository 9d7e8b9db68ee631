"""The Stellaris board's image in QEMU: boot, checked mode, dead-man, watchdog and restarts, by the board's own clock."""

import random
from collections.abc import Callable, Iterator

import pytest

from tests.firmware.qemu import Qemu

HANGS = "lm3s6965_hangs.elf"
Start = Callable[[str], Qemu]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts a machine with an image, and ends it."""
    machines: list[Qemu] = []

    def one(image: str) -> Qemu:
        machines.append(Qemu(image))
        return machines[-1]

    yield one
    for machine in machines:
        machine.close()


@pytest.fixture
def board(start: Start) -> Qemu:
    """The shipped sources' board, its banner sent."""
    machine = start("lm3s6965.elf")
    machine.wait_for("firmware\t1\t")
    return machine


def drive(board: Qemu, left: int, right: int) -> None:
    """Put a duty on the motors; the echo says that it was in force."""
    number = board.seal(f"s {left} {right}")
    board.wait_for(f"\ns\t{left}\t{right}\t{number}\t")


def test_the_board_boots_with_its_motors_off_and_says_who_it_is(board: Qemu) -> None:
    """Protocol 1, version 0.1, board 3, wheel loop alone (1), power on (1)."""
    board.wait_for(r"firmware\t1\t0\t1\t3\t1\t1\n")
    assert board.observed().duty == (0, 0)


def test_the_dead_man_stops_100_times_of_100(board: Qemu) -> None:
    """Whenever the host ends, in a line or after it: 0 no later than 0.26 s after the duty, by the board's clock."""
    chance = random.Random(22)
    board.seal("hello 1 250")
    board.wait_for("hello\t1\t250\t")
    for _ in range(100):
        drive(board, chance.randrange(50, 256), -chance.randrange(50, 256))
        board.write(b"s 200 200 9*12\r"[: chance.randrange(16)])
        stopped = board.await_standstill()
        assert 240_000 <= stopped.ended_us - stopped.began_us <= 260_000
        board.write(b"\r")
        board.forget()


@pytest.mark.parametrize(
    ("how", "cause"), [(1, 6), (2, 4), (3, 4)], ids=["hangs", "hangs with interrupts shut", "hangs, no tick"]
)
def test_a_main_loop_that_hangs_is_restarted(start: Start, how: int, cause: int) -> None:
    """It comes back with its motors off, and tells why: 6 is the tick's word, 4 the watchdog's."""
    board = start(HANGS)
    board.seal("hello 1 2000")
    board.wait_for("hello\t1\t2000\t")
    drive(board, 200, 200)
    board.forget()
    board.write(bytes([how]))
    board.wait_for(rf"firmware\t1\t0\t1\t3\t1\t{cause}\n")
    assert board.observed().duty == (0, 0)


def test_a_main_loop_that_is_late_now_and_then_is_not_restarted(start: Start) -> None:
    """Five times 0.15 s, between which it completes cycles: each begins the watchdog's two times of 0.125 s anew."""
    board = start(HANGS)
    board.wait_for("firmware\t1\t")
    board.forget()
    for _ in range(5):
        board.write(b"\x04")
        board.pass_time(0.2)
    assert "Initializing" not in board.text


def test_an_estop_outlives_a_restart(board: Qemu) -> None:
    """`estop`, `r`, and `s` is refused (4) until `arm 1`."""
    board.write(b"estop\r")
    board.write(b"r\r")
    board.wait_for(r"Reset Done[^*]*firmware\t1\t0\t1\t3\t1\t5\n")
    board.seal("hello 1 250")
    board.wait_for("hello\t1\t250\t")
    number = board.seal("s 80 80")
    board.wait_for(rf"refused\t4\t{number}\t")
    board.seal("arm 1")
    drive(board, 80, 80)
