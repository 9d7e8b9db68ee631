"""Lines in their order, and one among them taken out before its turn."""

import re

from hypothesis import given
from hypothesis import strategies as st

from chefbotd.rpc.arrivals import ByteArrival
from chefbotd.rpc.backlog import Backlog, ReceivedLine

NOW = ByteArrival(1.0, 0)


def backlog(*chunks: bytes, longest_bytes: int = 20) -> Backlog:
    """What has come in these chunks; whatever has an exclamation mark in it may be urgent."""
    waiting = Backlog(longest_bytes, re.compile(b"!"))
    for chunk in chunks:
        waiting.add(chunk, NOW)
    return waiting


def taken(waiting: Backlog) -> list[bytes]:
    """All that can be taken."""
    return [bytes(line.text) for line in iter(waiting.take_line, None)]


def stops_before(waiting: Backlog) -> list[tuple[bytes, int]]:
    """The same, and after how many stops each was sent."""
    return [(bytes(line.text), line.arrival.stops) for line in iter(waiting.take_line, None)]


def found(waiting: Backlog) -> list[bytes]:
    """All that is found; it stays."""
    lines = []
    while (line := waiting.find_urgent()) is not None:
        lines.append(bytes(line))
    return lines


def test_lines_come_in_order_and_are_complete() -> None:
    """Without line ends and space around; what has no end yet stays until there is no more to come."""
    waiting = backlog(b"a\r\n\n b \nc")
    assert taken(waiting) == [b"a", b"", b"b"]
    assert (len(waiting), waiting.unfinished) == (1, True)
    waiting.finish()
    assert taken(waiting) == [b"c"]
    waiting.finish()
    assert (len(waiting), waiting.unfinished, waiting.take_line()) == (0, False, None)


def test_what_is_found_stays_in_its_place_and_is_found_once() -> None:
    """Looking changes nothing of the order; what comes later is found later."""
    waiting = backlog(b"a\nb!\nc\nd!")
    assert found(waiting) == [b"b!"]
    waiting.add(b"!\n", NOW)
    assert found(waiting) == [b"d!!"]
    assert taken(waiting) == [b"a", b"b!", b"c", b"d!!"]


def test_what_stands_behind_a_stop_was_sent_after_it() -> None:
    """Of a, b, c!, d the last was, also when one of them has been taken meanwhile; of two stops each counts."""
    waiting = backlog(b"a\nb\nc!\nd\n")
    assert waiting.find_urgent() == b"c!"
    waiting.remove_found()
    waiting.record_own_stop(0, 1)
    assert stops_before(waiting) == [(b"a", 0), (b"b", 0), (b"d", 1)]
    waiting = backlog(b"a\nb\nc!\nd\ne!\nf\n")
    assert waiting.take_line() == ReceivedLine(bytearray(b"a"), NOW)
    for stops in range(2):
        assert waiting.find_urgent() is not None
        waiting.remove_found()
        waiting.record_own_stop(stops, stops + 1)
    assert stops_before(waiting) == [(b"b", 0), (b"d", 1), (b"f", 2)]


def test_a_stop_that_was_the_first_line_has_all_others_behind_it() -> None:
    """It was its turn, or it was taken out early: both are the same."""
    for early in (True, False):
        waiting = backlog(b"a!\nb\n")
        if early:
            assert waiting.find_urgent() == b"a!"
            waiting.remove_found()
        else:
            assert waiting.take_line() == ReceivedLine(bytearray(b"a!"), NOW)
        waiting.record_own_stop(0, 1)
        assert stops_before(waiting) == [(b"b", 1)]


def test_what_came_before_the_stop_of_another_stays_so_behind_a_stop_of_its_own() -> None:
    """Stop 5 was another client's, stop 6 is ours: what came before the fifth was not sent after it by that."""
    waiting = backlog()
    waiting.add(b"a!\nold\n", ByteArrival(1.0, 4))
    waiting.add(b"new\n", ByteArrival(1.1, 5))
    assert waiting.take_line() is not None
    waiting.record_own_stop(5, 6)
    assert stops_before(waiting) == [(b"old", 4), (b"new", 6)]


def test_a_line_is_as_old_as_its_first_byte() -> None:
    """However many chunks it came in, and whatever was taken before it."""
    waiting = backlog()
    waiting.add(b"a\nb", ByteArrival(1.0, 0))
    waiting.add(b"bb\nc\nd!\n", ByteArrival(1.5, 1))
    waiting.add(b"e\n", ByteArrival(2.5, 2))
    assert waiting.take_line() == ReceivedLine(bytearray(b"a"), ByteArrival(1.0, 0))
    assert waiting.find_urgent() == b"d!"
    waiting.remove_found()
    assert [waiting.take_line() for _ in range(3)] == [
        ReceivedLine(bytearray(b"bbb"), ByteArrival(1.0, 0)),
        ReceivedLine(bytearray(b"c"), ByteArrival(1.5, 1)),
        ReceivedLine(bytearray(b"e"), ByteArrival(2.5, 2)),
    ]


def test_a_line_that_is_too_long_is_told_and_not_found() -> None:
    """Of up to 20 bytes; one more is too many, with or without its end."""
    assert [backlog(b"!" * n + b"\n").too_long for n in (20, 21)] == [False, True]
    assert [backlog(b"!" * n).too_long for n in (20, 21)] == [False, True]
    assert found(backlog(b"!" * 21 + b"\n" + b"!" * 20 + b"\n")) == [b"!" * 20]


def test_what_has_been_seen_can_be_dropped_and_so_can_a_line_without_end() -> None:
    """Then what comes is only looked through, in bounded memory: the rest of a line that is too long is passed over."""
    waiting = backlog(b"a\nb!\n" + b"x" * 15)
    assert found(waiting) == [b"b!"]
    waiting.drop_searched()
    assert len(waiting) == 15
    for _ in range(1000):
        waiting.add(b"!" * 15, NOW)
        assert waiting.find_urgent() is None
        waiting.drop_searched()
        assert len(waiting) == 0
    waiting.add(b"! of the same\nc!\nd", NOW)
    assert found(waiting) == [b"c!"]
    waiting.drop_searched()
    assert len(waiting) == 1


def test_the_first_line_can_be_seen() -> None:
    """It stays; while it is not complete it is empty."""
    assert (backlog(b"ab").first_line(), backlog(b"ab\nc\n").first_line()) == (b"", b"ab")


def test_what_is_cleared_is_gone() -> None:
    """Nothing is left of what was seen either."""
    waiting = backlog(b"a\nb!\n")
    assert waiting.find_urgent() == b"b!"
    waiting.remove_found()
    waiting.clear()
    waiting.add(b"c!\n", NOW)
    assert found(waiting) == [b"c!"]
    assert taken(waiting) == [b"c!"]


LINES = st.lists(st.text("ab!", max_size=6).map(str.encode))


@given(LINES, st.data())
def test_no_line_is_lost_or_doubled_however_it_is_cut(lines: list[bytes], data: st.DataObject) -> None:
    """In any chunks and any mixture of both ways out: each line comes out once, and the others keep their order."""
    stream = b"".join(line + b"\n" for line in lines)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    waiting, ordered, early = backlog(), list[bytes](), list[bytes]()
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        waiting.add(stream[start:end], NOW)
        for looks in data.draw(st.lists(st.booleans(), max_size=4)):
            if looks and (line := waiting.find_urgent()) is not None:
                waiting.remove_found()
                early.append(bytes(line))
            elif not looks and (served := waiting.take_line()) is not None:
                ordered.append(bytes(served.text))
    ordered += taken(waiting)
    assert sorted(ordered + early) == sorted(lines)
    assert all(b"!" in line for line in early)
    calm = [line for line in lines if b"!" not in line]
    assert [line for line in ordered if b"!" not in line] == calm
