"""Telling a board from silence, a wrong baud rate and a wrong device."""

import random

import pytest

from chefbotd.link.health import Condition, HealthWatch, Heard, LinkHealth, show
from tests.scenarios.wires import misread

GPS = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9*47\r\n"


def judged(heard: Heard, sample: bytes, *, waited_s: float = 2.0) -> LinkHealth | None:
    """What is made of so much heard since the port was opened."""
    return HealthWatch(100.0, Heard()).look(100.0 + waited_s, heard, sample, health_after_s=2.0)


def test_frames_are_a_board():
    """Twenty lines that are frames are healthy at once, with nothing to explain."""
    assert judged(Heard(400, 20, 20), b"u\t12\n", waited_s=0.1) == LinkHealth(Condition.HEALTHY, "")


@pytest.mark.parametrize(("frames", "condition"), [(2, Condition.HEALTHY), (1, Condition.WRONG_DEVICE)])
def test_one_line_in_ten_is_enough(frames: int, condition: Condition):
    """Of twenty lines two frames are a board on a bad cable; one is chance."""
    health = judged(Heard(400, 20, frames), GPS)
    assert health is not None
    assert health.condition is condition


def test_nothing_at_all_is_silence():
    """Not a byte for two seconds: the reason says how long, and what to look at."""
    health = judged(Heard(), b"")
    assert health is not None
    assert health.condition is Condition.SILENT
    assert "2.0 s" in health.reason
    assert "powered" in health.reason


def test_text_that_is_no_frame_is_another_device():
    """A GPS receiver: what it said is quoted, on one line."""
    health = judged(Heard(500, 10, 0), GPS)
    assert health is not None
    assert health.condition is Condition.WRONG_DEVICE
    assert "$GPGGA,123519" in health.reason
    assert "\\r\\n" in health.reason


def test_bytes_that_are_no_text_are_a_wrong_baud_rate():
    """Random bytes, with or without a line end among them, suggest the baud rate; the quote is bounded and printable."""
    noise = random.Random(1).randbytes(128)
    for lines in (0, 5):
        health = judged(Heard(5000, lines, 0), noise)
        assert health is not None
        assert health.condition is Condition.WRONG_BAUD
        assert "baud" in health.reason
        assert health.reason.isprintable()
        assert len(health.reason) < 400


def test_too_little_is_not_judged():
    """Nineteen lines in less than the time of judgement say nothing yet, and neither does a moment's silence."""
    assert judged(Heard(400, 19, 0), GPS, waited_s=1.9) is None
    assert judged(Heard(), b"", waited_s=1.9) is None


def test_only_changes_are_told():
    """Silent, silent, then a board, then silent again: three reports, each on what was heard since the one before."""
    watch = HealthWatch(0.0, Heard())
    board = Heard(400, 20, 20)
    looks = [
        watch.look(2.0, Heard(), b"", health_after_s=2.0),
        watch.look(4.0, Heard(), b"", health_after_s=2.0),
        watch.look(4.1, board, b"u\t1\n", health_after_s=2.0),
        watch.look(6.2, board, b"u\t1\n", health_after_s=2.0),
    ]
    told = [None if health is None else health.condition for health in looks]
    assert told == [Condition.SILENT, None, Condition.HEALTHY, Condition.SILENT]


def test_shown_bytes_are_printable_and_bounded():
    """Tabs and line ends by their names, the rest in hexadecimal, and an ellipsis for what was cut."""
    assert show(b"e\t1\r\n\x00\xff") == "e\\t1\\r\\n\\x00\\xff"
    assert show(b"x" * 65) == "x" * 64 + "..."


@pytest.mark.parametrize("baud", [9600, 19_200, 38_400, 57_600, 230_400, 460_800, 921_600])
def test_a_boards_lines_at_another_baud_rate_are_told_as_such(baud: int):
    """What a port at 115200 makes of them is text by chance at most; however it falls, the baud rate is suspected."""
    said = b"".join(b"t\t%d\t0.02\ne\t%d\t%d\nu\t57\n" % (20_000 * n, 77 * n, -81 * n) for n in range(1, 100))
    heard = misread(said, baud / 115_200)
    for start in range(0, len(heard) - 128, 61):
        health = judged(Heard(5000, 20, 0), heard[start : start + 128])
        assert health is not None
        assert health.condition is Condition.WRONG_BAUD
