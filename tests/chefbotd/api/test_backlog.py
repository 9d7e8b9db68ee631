"""Lines in their order, and one among them taken out before its turn."""

import re

from hypothesis import given
from hypothesis import strategies as st

from chefbotd.api.backlog import Backlog


def backlog(*chunks: bytes, longest_bytes: int = 20) -> Backlog:
    """What has come in these chunks; whatever has an exclamation mark in it may be urgent."""
    waiting = Backlog(longest_bytes, re.compile(b"!"))
    for chunk in chunks:
        waiting.add(chunk)
    return waiting


def taken(waiting: Backlog) -> list[tuple[bytes, bool]]:
    """All that can be taken, and whether it was overtaken."""
    lines = []
    while (line := waiting.take()) is not None:
        lines.append((bytes(line.text), line.overtaken))
    return lines


def found(waiting: Backlog) -> list[bytes]:
    """All that is found; it stays."""
    lines = []
    while (line := waiting.find()) is not None:
        lines.append(bytes(line))
    return lines


def test_lines_come_in_order_and_are_complete() -> None:
    """Without line ends and space around; what has no end yet stays until there is no more to come."""
    waiting = backlog(b"a\r\n\n b \nc")
    assert taken(waiting) == [(b"a", False), (b"", False), (b"b", False)]
    assert (len(waiting), waiting.unfinished) == (1, True)
    waiting.finish()
    assert taken(waiting) == [(b"c", False)]
    waiting.finish()
    assert (len(waiting), waiting.unfinished, waiting.take()) == (0, False, None)


def test_what_is_found_stays_in_its_place_and_is_found_once() -> None:
    """Looking changes nothing of the order; what comes later is found later."""
    waiting = backlog(b"a\nb!\nc\nd!")
    assert found(waiting) == [b"b!"]
    waiting.add(b"!\n")
    assert found(waiting) == [b"d!!"]
    assert taken(waiting) == [(b"a", False), (b"b!", False), (b"c", False), (b"d!!", False)]


def test_what_is_taken_out_overtakes_what_was_before_it_only() -> None:
    """Of a, b, c!, d the first two are overtaken, also when one of them has been taken meanwhile."""
    waiting = backlog(b"a\nb\nc!\nd\n")
    assert waiting.find() == b"c!"
    waiting.take_found()
    assert taken(waiting) == [(b"a", True), (b"b", True), (b"d", False)]
    waiting = backlog(b"a\nb\nc!\nd\ne!\nf\n")
    assert waiting.take() == (b"a", False)
    for _ in range(2):
        assert waiting.find() is not None
        waiting.take_found()
    assert taken(waiting) == [(b"b", True), (b"d", True), (b"f", False)]


def test_the_first_line_can_be_taken_out_and_overtakes_nothing() -> None:
    """It was its turn."""
    waiting = backlog(b"a!\nb\n")
    assert waiting.find() == b"a!"
    waiting.take_found()
    assert taken(waiting) == [(b"b", False)]


def test_a_line_that_is_too_long_is_told_and_not_found() -> None:
    """Of up to 20 bytes; one more is too many, with or without its end."""
    assert [backlog(b"!" * n + b"\n").too_long for n in (20, 21)] == [False, True]
    assert [backlog(b"!" * n).too_long for n in (20, 21)] == [False, True]
    assert found(backlog(b"!" * 21 + b"\n" + b"!" * 20 + b"\n")) == [b"!" * 20]


def test_what_has_been_seen_can_be_dropped_and_so_can_a_line_without_end() -> None:
    """Then what comes is only looked through, in bounded memory: the rest of a line that is too long is passed over."""
    waiting = backlog(b"a\nb!\n" + b"x" * 15)
    assert found(waiting) == [b"b!"]
    waiting.drop_seen()
    assert len(waiting) == 15
    for _ in range(1000):
        waiting.add(b"!" * 15)
        assert waiting.find() is None
        waiting.drop_seen()
        assert len(waiting) == 0
    waiting.add(b"! of the same\nc!\nd")
    assert found(waiting) == [b"c!"]
    waiting.drop_seen()
    assert len(waiting) == 1


def test_the_first_line_can_be_seen() -> None:
    """It stays; while it is not complete it is empty."""
    assert (backlog(b"ab").first(), backlog(b"ab\nc\n").first()) == (b"", b"ab")


def test_what_is_cleared_is_gone() -> None:
    """Nothing is left of what was seen or overtaken either."""
    waiting = backlog(b"a\nb!\n")
    assert waiting.find() == b"b!"
    waiting.take_found()
    waiting.clear()
    waiting.add(b"c!\n")
    assert found(waiting) == [b"c!"]
    assert taken(waiting) == [(b"c!", False)]


LINES = st.lists(st.text("ab!", max_size=6).map(str.encode))


@given(LINES, st.data())
def test_no_line_is_lost_or_doubled_however_it_is_cut(lines: list[bytes], data: st.DataObject) -> None:
    """In any chunks and any mixture of both ways out: each line comes out once, and the others keep their order."""
    stream = b"".join(line + b"\n" for line in lines)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    waiting, ordered, early = backlog(), list[bytes](), list[bytes]()
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        waiting.add(stream[start:end])
        for looks in data.draw(st.lists(st.booleans(), max_size=4)):
            if looks and (line := waiting.find()) is not None:
                waiting.take_found()
                early.append(bytes(line))
            elif not looks and (served := waiting.take()) is not None:
                ordered.append(bytes(served.text))
    ordered += [text for text, _ in taken(waiting)]
    assert sorted(ordered + early) == sorted(lines)
    assert all(b"!" in line for line in early)
    calm = [line for line in lines if b"!" not in line]
    assert [line for line in ordered if b"!" not in line] == calm
