"""Summing up what a board's port says."""

import random

import pytest

from chefbotd.components.doctor.listening.line_survey import LineSurvey, echo_delays_s, line_bytes
from chefbotd.components.simulation.lidar import heard_at


def cycles(
    count: int, *, wheels: int = 2, board_hz: float = 20.0, ppm: float = 0.0
) -> list[tuple[float, bytes]]:
    """So many cycles of a board whose clock runs ``ppm`` fast, in one read each, and when."""
    pieces = []
    for index in range(count):
        at_s = index / board_hz
        micros = round(at_s * (1 + ppm * 1e-6) * 1e6) + 4_294_000_000
        counts = "\t".join(str(7 * index + wheel) for wheel in range(wheels))
        duty = "\t".join(["0.00"] * wheels)
        pieces.append((at_s, f"t\t{micros % 2**32}\t0.05\ne\t{counts}\ns\t{duty}\n".encode()))
    return pieces


def heard_of(pieces: list[tuple[float, bytes]], configured: str = "classic"):
    """What a survey makes of them."""
    survey = LineSurvey(configured, 0.0)
    for at_s, piece in pieces:
        survey.feed(piece, at_s)
    return survey.heard(pieces[-1][0])


def test_kinds_rates_counts_and_clock():
    """101 cycles of 20 Hz whose clock wraps on the way and runs 400 millionths fast."""
    heard = heard_of(cycles(101, ppm=400.0))
    assert heard.kinds == {"t": 101, "e": 101, "s": 101}
    assert heard.rates_hz["e"] == pytest.approx(20.0)
    assert heard.counted == (700, 700)
    assert heard.duty == (0.0, 0.0)
    assert heard.clock_ppm == pytest.approx(400.0, abs=1.0)
    assert heard.is_board
    assert not heard.damaged


def test_a_busy_computer_is_no_drifting_clock():
    """Two of three reads are up to 90 ms late, more of them towards the end: the least late ones tell 400 millionths."""
    chance = random.Random(5)
    pieces = [
        (at_s + (0.0 if index % 3 == 0 else chance.random() * 0.09 * index / 100), piece)
        for index, (at_s, piece) in enumerate(cycles(101, board_hz=10.0, ppm=400.0))
    ]
    assert heard_of(pieces).clock_ppm == pytest.approx(400.0, abs=20.0)


def test_a_computer_that_is_later_and_later_tells_no_drift():
    """Every read from the middle on is later than the one before: that is no clock, and nothing is told."""
    pieces = [(at_s + max(0, index - 50) * 0.01, piece) for index, (at_s, piece) in enumerate(cycles(101))]
    assert heard_of(pieces).clock_ppm is None


def test_four_wheels_on_a_wire_that_is_configured_for_two():
    """The variant that understands is told, with its wheels; the configured one wins where both do."""
    heard = heard_of(cycles(20, wheels=4))
    assert (heard.wire, heard.wheels) == ("four_wheels", 4)
    assert heard_of(cycles(20, wheels=4), "khan").wire == "khan"


def test_chunking_does_not_matter():
    """Byte by byte as in one read, but for when."""
    data = b"".join(piece for _, piece in cycles(30))
    whole = heard_of([(0.0, b""), (1.0, data)])
    bytewise = heard_of([(0.0, b"")] + [(1.0, bytes([byte])) for byte in data])
    assert (whole.kinds, whole.counted, whole.bytes) == (bytewise.kinds, bytewise.counted, bytewise.bytes)


def test_a_wrong_baud_rate_is_garbled():
    """A board of 115200 heard at half of it is no board, and no text."""
    data = b"".join(piece for _, piece in cycles(60))
    heard = heard_of([(0.0, b""), (2.0, heard_at(data, 0.5))])
    assert not heard.is_board
    assert heard.is_garbled


def test_noise_is_counted_with_an_example():
    """Letters among the digits: the reason is counted, and one line is shown."""
    pieces = cycles(50)
    pieces[20] = (1.0, b"e\t1x\t5\n")
    heard = heard_of(pieces)
    assert heard.damaged == {"not_a_number": 1}
    assert heard.example == "e\\t1x\\t5"


def test_no_bytes_break_it():
    """Noise of every kind is taken."""
    chance = random.Random(4)
    survey = LineSurvey("classic", 0.0)
    for at in range(200):
        survey.feed(chance.randbytes(chance.randrange(80)), at * 0.01)
    assert survey.heard(2.0).bytes > 0


def test_lines_as_the_topic_raw_shows_them():
    """Escaped bytes become what they were; a backslash of the board's own stays one."""
    assert line_bytes("e\t1\t\\xff2") == b"e\t1\t\xff2\n"


def test_delays_of_echoes():
    """Each new command to its first echo; repetitions, other lines and overtaken commands count for nothing."""
    lines = [
        (0.00, True, b"s 40 -7"),
        (0.01, False, b"s\t0.00\t0.00"),
        (0.02, True, b"s 40 -7"),
        (0.03, False, b"e\t1\t2"),
        (0.06, False, b"s\t40.00\t-7.00"),
        (0.07, True, b"s 50 -7"),
        (0.08, True, b"s 60 -7"),
        (0.11, False, b"s\t60.00\t-7.00"),
        (0.12, False, b""),
        (0.13, True, b"r"),
    ]
    assert echo_delays_s(lines, 2) == pytest.approx([0.06, 0.03])
