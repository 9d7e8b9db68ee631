"""Bytes become lines, however they are cut, and none that is incomplete is obeyed."""

import random

import pytest

from tests.firmware import host


def counters(board: host.Board) -> list[int]:
    """CRC, refused, overrun, gaps, dead-man, late, as they are now."""
    board.hello()
    board.run(0.16)
    return [int(field) for field in board.bodies("counters")[-1][1:]]


@pytest.mark.parametrize("seed", range(5))
def test_chunks_never_matter(board: host.Board, seed: int) -> None:
    """A stream cut anywhere has the same answers as the whole."""
    stream = b"".join(host.seal(f"g {n % 6} {500 + n} {n}").encode() + b"\r" for n in range(40))
    stream = host.seal("hello 1 2000 255").encode() + b"\r" + stream
    luck = random.Random(seed)
    board.forget()
    while stream:
        size = luck.randint(1, 9)
        board.receive(stream[:size])
        board.step()
        stream = stream[size:]
    assert board.bodies("g") == [["g", str(n % 6), str(500 + n)] for n in range(40)]


def test_a_line_of_64_bytes_is_read_and_a_longer_one_is_not(board: host.Board) -> None:
    """As in the classic sketch's buffer."""
    board.write("s " + "1".zfill(61) + " 2")
    assert board.duty == (0, 0)
    board.write("s " + "1".zfill(60) + " 2")
    assert board.duty == (1, 2)


def test_line_feeds_are_ignored(board: host.Board) -> None:
    """A terminal may end its lines with CR LF."""
    board.receive(b"s 1 2\r\n")
    board.step()
    board.receive(b"s 3 4\r\n")
    board.step()
    assert board.duty == (3, 4)


def test_what_finds_no_room_is_lost_with_its_line_alone(board: host.Board) -> None:
    """The ring holds 128 bytes: of 130 two are lost, one of them an end: what is refused goes on to the next end."""
    board.receive(b"s 1 2\r" + b"s 3 4 " + b" " * 112 + b"s 5 6\r")
    board.step()
    board.step()
    assert board.duty == (1, 2)
    board.write("s 7 8")
    assert board.duty == (1, 2)
    board.write("s 9 10")
    assert board.duty == (9, 10)


def test_each_lost_byte_is_counted(board: host.Board) -> None:
    """200 bytes at once are 72 too many; their line is refused."""
    board.receive(b"x" * 200)
    board.step()
    board.write("")
    assert counters(board)[:3] == [0, 1, 72]


def test_a_line_with_a_lost_byte_is_refused_in_both_modes(board: host.Board) -> None:
    """`s 120 80` without its 1 would be a motion, too."""
    board.receive(b"s ")
    board.receive_lost()
    board.receive(b"20 80\r")
    board.step()
    assert board.duty == (0, 0)


def test_the_loss_is_not_forgotten_before_its_line(board: host.Board) -> None:
    """A byte lost just after a line's end belongs to the next line."""
    board.receive(b"s 1 2\r")
    board.receive_lost()
    board.receive(b"0 s 3 4\r")
    board.step()
    assert board.duty == (1, 2)
    board.step()
    assert board.duty == (1, 2)


def test_all_lines_that_wait_are_read_in_one_pass(board: host.Board) -> None:
    """Nine lines in one write; the last one's duty is in force after the next pass."""
    board.receive(b"".join(b"s %d %d\r" % (number, number) for number in range(1, 10)))
    board.step()
    assert board.duty == (9, 9)


def test_empty_lines_take_no_room(board: host.Board) -> None:
    """Neither 300 lone CRs, nor CR LF as often, cost the line behind them."""
    board.receive(b"\r" * 300 + b"\r\n" * 300 + b"s 3 4\r")
    board.step()
    assert board.duty == (3, 4)
    assert counters(board)[:3] == [0, 0, 0]


def test_more_line_ends_than_are_stamped_are_a_loss(board: host.Board) -> None:
    """32 ends may wait; the 33rd line and the next are refused, as neither has its time."""
    board.receive(b"x\r" * 31 + b"s 1 1\rs 2 2\r")
    board.step()
    assert board.duty == (1, 1)
    board.write("s 3 3")
    assert board.duty == (1, 1)
    board.write("s 4 4")
    assert board.duty == (4, 4)


def test_a_pause_of_a_second_ends_a_line_that_was_cut(board: host.Board) -> None:
    """A host that died in a line spoils nothing of the next one's; a hand at a terminal may type slowly."""
    board.write("s 5 5")
    board.receive(b"s 12")
    board.run(0.9)
    board.receive(b"0 7\r")
    board.step()
    assert board.duty == (120, 7)
    board.receive(b"s 1")
    board.run(1.1)
    board.write("s 0 0")
    assert board.duty == (0, 0)
    assert counters(board)[:2] == [0, 1]


def test_no_byte_can_restart_or_hang_the_board(board: host.Board) -> None:
    """A megabyte of noise in the checked mode: no duty, no restart, and the next line is obeyed."""
    board.hello(2000)
    luck = random.Random(3)
    for number in range(4000):
        board.receive(luck.randbytes(100))
        for _ in range(12):
            board.step()
        if number % 10 == 0:
            board.run(0.001)
    assert (board.duty, board.fake.restarts) == ((0, 0), 0)
    board.write("")
    board.hello()
    board.seal("s 5 6")
    assert board.duty == (5, 6)
