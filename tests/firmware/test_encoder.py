"""All four edges of the quadrature count, from the levels that the pins have at the start."""

import pytest

from tests.firmware import host, tools


def counts(board: host.Board) -> tuple[int, int]:
    """What the next cycle tells."""
    board.forget()
    board.run(0.02)
    line = next(line for line in board.sent if line.startswith("e\t"))
    _, left, right = line.split("\t")
    return int(left), int(right)


def test_four_edges_are_four_counts_either_way(board: host.Board) -> None:
    """A before B is forward."""
    for before, after in host.TURN:
        assert board.fake.levels[0] == before
        board.encoder(0, after)
    assert counts(board) == (4, 0)
    for levels in (1, 3, 2, 0, 1):
        board.encoder(0, levels)
    assert counts(board) == (-1, 0)


@pytest.mark.parametrize("levels", range(4))
def test_the_first_edge_counts_one_from_any_levels(levels: int) -> None:
    """The state is read from the pins at the start: else it would be 0 or miscounted by 2."""
    tools.need("gcc", "make")
    board = host.Board()
    board.fake.levels[:] = (levels, levels)
    board.start(host.PIN)
    board.edges(0, 1)
    board.edges(1, -1)
    assert counts(board) == (1, -1)


def test_a_repeated_or_impossible_edge_counts_nothing(board: host.Board) -> None:
    """A bounce, and both levels at once, whose direction nobody knows."""
    board.encoder(0, 0)
    board.encoder(0, 3)
    board.encoder(0, 3)
    board.encoder(0, 0)
    board.encoder(0, 2)
    assert counts(board) == (1, 0)


def test_a_bounce_between_two_levels_adds_up_to_nothing(board: host.Board) -> None:
    """There and back again."""
    for _ in range(100):
        board.encoder(1, 2)
        board.encoder(1, 0)
    assert counts(board) == (0, 0)


def test_counts_wrap_as_int32(board: host.Board) -> None:
    """After 2147483647 comes -2147483648: after 51 hours at full speed; and the other way round."""
    for _ in range(65_538):  # of 32767 counts each: 2147483646
        board.forget()
        board.turn(0, 32_767)
        board.turn(1, -32_767)
        board.hold_up(20)
        board.step()
    assert "e\t2147483646\t-2147483646" in board.sent
    board.edges(0, 3)
    board.edges(1, -3)
    assert counts(board) == (-2_147_483_647, 2_147_483_647)


def test_no_edge_is_lost_in_a_million(board: host.Board) -> None:
    """23,200 edges a second on both wheels for 43 s, over the wrap of the 16 bits that the interrupt counts with."""
    for _ in range(4310):
        board.edges(0, 116)
        board.edges(1, -116)
        board.run(0.01)
    assert counts(board) == (499_960, -499_960)
