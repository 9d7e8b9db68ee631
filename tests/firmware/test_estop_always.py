"""An e-stop is obeyed behind anything and after anything: the receive interrupt itself knows its word.

Each backlog comes in while the main loop reads nothing, as it does behind a long line, and the tick follows a
millisecond later. So many of them are tried that a promise of "always" means something; a share of them runs on the
emulated board.
"""

import random
from collections.abc import Callable

import pytest

from chefbotd.components.simulation.simavr import CYCLES_S
from tests.firmware import host
from tests.firmware.emulator import Emulated

BACKLOGS = 10_000
EMULATED_BACKLOGS = 60
SIMAVR_BIT_S = 1 / 115_200
"""A byte takes simavr's UART eleven bits."""


def _sealed(luck: random.Random) -> str:
    body = luck.choice(("s 0 0", "s 50 -50", "w 100 100", "g 1 5", "hello 1 250", "arm 0", "x"))
    return host.seal(f"{body} {luck.randrange(256)}")


PIECES: tuple[Callable[[random.Random], bytes], ...] = (
    lambda luck: b"s 0 0\r" * luck.randrange(1, 40),
    lambda luck: b"\r" * luck.randrange(1, 200),
    lambda luck: b"\r\n" * luck.randrange(1, 100),
    lambda luck: b"x\r" * luck.randrange(1, 80),
    lambda luck: b"s %d %d\r" % (luck.randrange(-255, 256), luck.randrange(-255, 256)),
    lambda luck: (_sealed(luck) + "\r").encode() * luck.randrange(1, 12),
    lambda luck: _sealed(luck).encode()[: luck.randrange(1, 12)],  # a line that a dead host cut
    lambda luck: b"y" * luck.randrange(1, 300),
    lambda luck: b"y" * luck.randrange(1, 300) + b"\r",
    lambda luck: luck.randbytes(luck.randrange(1, 200)),
    lambda luck: b"e" * luck.randrange(1, 9) + b"esto",
)


def backlog(luck: random.Random) -> bytes:
    """What a host may have written just before its `estop`: short lines, long ones, cut ones, noise."""
    return b"".join(luck.choice(PIECES)(luck) for _ in range(luck.randrange(1, 5)))


def latched(board: host.Board) -> bool:
    """Whether a motion is refused now, in the mode that the board is in: the motors stand."""
    moved = board.duty
    board.write("")
    board.seal("s 77 77")
    board.write("s 77 77")
    return moved == (0, 0) == board.duty


@pytest.mark.parametrize("is_checked", [False, True], ids=["classic", "checked"])
def test_an_estop_behind_any_backlog_is_latched(board: host.Board, is_checked: bool) -> None:
    """10,000 random backlogs in one write with their `estop`: all latched by the next tick, without a pass."""
    luck = random.Random(38)
    missed = []
    for number in range(BACKLOGS):
        board.start(host.POWER_ON)
        if is_checked:
            board.hello()
        board.seal("s 90 90") if is_checked else board.write("s 90 90")
        before = backlog(luck)
        board.receive(before + b"estop\r")
        board.hold_up(1)
        if board.duty != (0, 0) or not latched(board):
            missed.append((number, before))
    assert missed == []


@pytest.mark.parametrize("lines", [b"s 0 0\r" * 20, b"\r" * 12, b"s 0 0 123*ABCDE.\r" * 55])
@pytest.mark.parametrize("is_checked", [False, True], ids=["classic", "checked"])
def test_short_lines_hide_no_estop(board: host.Board, lines: bytes, is_checked: bool) -> None:
    """20 stops, twelve lone CRs, 55 lines of 17 bytes, and `estop` in one write."""
    if is_checked:
        board.hello()
    board.receive(lines + b"estop\r")
    board.step()
    assert latched(board)


@pytest.mark.parametrize("at_ms", range(0, 50, 3))
def test_an_estop_after_r_is_kept_over_its_restart(board: host.Board, at_ms: int) -> None:
    """Whenever in the 50 ms it comes, the program begins anew with the stop in force."""
    board.write("r")
    board.run(at_ms / 1000)
    board.receive(b"estop\r")
    board.run(0.06)
    assert board.fake.restarts == 1
    board.start(host.SOFTWARE)
    assert latched(board)


@pytest.mark.parametrize("split", range(1, 7))
def test_a_restart_in_the_middle_of_the_word_loses_nothing(board: host.Board, split: int) -> None:
    """The letters before it are kept; half a word makes no stop."""
    board.write("r")
    board.receive(b"estop\r"[:split])
    board.run(0.06)
    board.start(host.SOFTWARE)
    board.receive(b"estop\r"[split:])
    board.hold_up(1)
    assert latched(board)
    board.start(host.POWER_ON)
    board.receive(b"estop"[: split - 1])
    board.start(host.PIN)
    board.receive(b"estop"[split - 1 :] + b" \r")
    board.run(0.01)
    board.write("s 7 7")
    assert board.duty == (7, 7)


@pytest.mark.parametrize("split", range(7))
def test_an_estop_that_comes_in_while_the_program_restarts_is_kept(board: host.Board, split: int) -> None:
    """The letters before the restart, in it, and the rest after it."""
    board.receive(b"x\r" + b"estop\r"[:split])
    board.run(0.01)
    board.write("r")
    board.run(0.06)
    board.receive(b"estop\r"[:split])
    board.receive_early(b"estop\r"[split:])
    board.start(host.SOFTWARE)
    board.hold_up(1)
    assert latched(board)


def test_an_estop_just_before_a_restart_by_the_watchdog_is_kept(board: host.Board) -> None:
    """Neither tick nor main loop came to it: the restart itself does."""
    board.receive(b"estop\r")
    board.watchdog()
    board.start(host.SOFTWARE)
    assert latched(board)


@pytest.mark.parametrize("cut", ["s 12", "hello 1 25", "s 0 0 17*8A", "estop", "esto", "x" * 100, "\x00\xff"])
def test_a_cut_line_swallows_no_estop(board: host.Board, cut: str) -> None:
    """What a dead host has left stands before the next host's first word: a line that ends in `estop` is one."""
    board.receive(cut.encode("latin-1"))
    board.run(0.01)
    board.write("estop")
    assert latched(board)


def test_lost_bytes_before_the_word_do_not_matter(board: host.Board) -> None:
    """The UART lost some of the line before: the letters themselves came."""
    for _ in range(3):
        board.receive_lost()
    board.receive(b"estop\r")
    board.step()
    assert latched(board)


def test_a_main_loop_that_hangs_hears_an_estop(board: host.Board) -> None:
    """The tick alone latches it, in the millisecond after its last byte."""
    board.write("s 90 90")
    board.receive(b"estop\r")
    assert board.duty == (90, 90)
    board.hold_up(1)
    assert board.duty == (0, 0)


def test_each_estop_of_a_batch_has_its_number_and_no_older_arm_ends_it(board: host.Board) -> None:
    """`estop`, `arm 1`, `estop` in one write: the arm is for the first one, and is refused (6)."""
    board.hello()
    board.receive(b"estop\r" + (host.seal("arm 1 9") + "\r").encode() + b"estop\r")
    board.step()
    assert board.bodies("refused") == [["refused", "6", "9"]]
    board.seal("arm 2")
    board.seal("s 9 9")
    assert board.duty == (9, 9)


@pytest.mark.parametrize("line", ["estop 1", "estopp", "stop", "e stop", "ESTOP", "estop\x00"])
def test_nothing_else_is_an_estop(board: host.Board, line: str) -> None:
    """The word ends its line, letter for letter."""
    board.write(line)
    board.write("s 7 7")
    assert board.duty == (7, 7)


# On the emulated board, whose receive interrupt is that of the part


@pytest.mark.parametrize("is_checked", [False, True], ids=["classic", "checked"])
def test_the_emulated_board_latches_behind_any_backlog(is_checked: bool) -> None:
    """At full rate through the UART: the motors are off 3 ms after the last byte, and a motion is refused then."""
    luck = random.Random(5)
    board = Emulated()
    missed = []
    for number in range(EMULATED_BACKLOGS):
        board.board.reset(power_on=True)
        board.run(0.1)
        if is_checked:
            board.hello()
            board.seal("s 90 90")
        else:
            board.write("s 90 90")
        board.run(0.01)
        before = backlog(luck)
        board.board.receive(before + b"estop\r", round(board.now_s * CYCLES_S))
        board.run_to(board.board.received_cycle / CYCLES_S + 0.003 + len(before) * SIMAVR_BIT_S)
        stopped = board.board.duty == (0, 0)
        board.write("s 77 77")
        board.seal("s 77 77")
        board.run(0.02)
        if not stopped or board.board.duty != (0, 0):
            missed.append((number, before))
    assert missed == []


def test_the_emulated_board_latches_whenever_an_estop_follows_r() -> None:
    """In the 50 ms before the restart, in it and after it: 60 moments over 70 ms."""
    board = Emulated()
    missed = []
    for number in range(60):
        board.board.reset(power_on=True)
        board.run(0.1)
        board.write("r")
        board.run_to(board.now_s + 0.0002 + 0.00117 * number)
        board.write("estop")
        board.run(0.2)
        board.write("s 77 77")
        board.run(0.02)
        if board.board.duty != (0, 0):
            missed.append(number)
    assert missed == []
