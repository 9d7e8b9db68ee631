"""LD19 packets to whole turns: angles, times, and whatever a line can do to them."""

import itertools
import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.link.lidar.ld19_reader import Ld19Reader
from chefbotd.link.lidar.turn import LidarTurn
from tests.budget import examples
from tests.fakes.lidar import ld19_bytes, ld19_packets, noisy_box, stalled_ld19_packets

BAUD = 230_400
PACKET_S = 47 * 10 / BAUD


def read(chunks: list[bytes]) -> tuple[Ld19Reader, list[LidarTurn]]:
    """A reader and the turns that it made of chunks that all came in at 100 s."""
    reader = Ld19Reader(BAUD)
    return reader, [turn for chunk in chunks for turn in reader.read_bytes(chunk, 100.0)]


def test_a_turn_is_what_lies_between_two_zero_marks() -> None:
    """From 123.4 degrees on: the first 236.6 degrees are no turn; then 450 beams of 0.8 degrees each, all around."""
    _, turns = read(ld19_bytes(noisy_box(), 120))
    assert [len(turn.range_m) for turn in turns] == [450, 450]
    for turn in turns:
        assert np.degrees(turn.clockwise_rad) == pytest.approx(turn_degrees(turn), abs=1e-6)
        assert 0 <= turn.clockwise_rad[0] < math.radians(0.8)


def turn_degrees(turn: LidarTurn) -> list[float]:
    """Even steps of 0.8 degrees from the first beam on."""
    return [math.degrees(turn.clockwise_rad[0]) + 0.8 * index for index in range(450)]


def test_ranges_stand_at_their_angles() -> None:
    """In a box the wall ahead is 2 m away, the one at the right, a quarter clockwise, 1 m; noise is 5 mm."""
    _, (turn, *_) = read(ld19_bytes(noisy_box(), 120))
    nearest = {
        degrees: np.argmin(abs(turn.clockwise_rad - math.radians(degrees))) for degrees in (0, 90, 270)
    }
    assert turn.range_m[nearest[0]] == pytest.approx(2.0, abs=0.03)
    assert turn.range_m[nearest[90]] == pytest.approx(1.0, abs=0.03)
    assert turn.range_m[nearest[270]] == pytest.approx(1.0, abs=0.03)


def test_each_beam_has_its_time_on_the_host_s_clock() -> None:
    """Packets come in 5 ms late and up to 12 ms more: a beam's time is right to 8 ms, over the wrap of the stamps too.

    The lidar's clock began at 29.5 s, and wraps after half a second; what is late by the same for all cannot be known.
    """
    rng, reader, turns = random.Random(3), Ld19Reader(BAUD), []
    for at_s, data in itertools.islice(ld19_packets(noisy_box()), 1500):
        late_s = 0.005 + PACKET_S + rng.choice((0.0, 0.0, 0.012))
        turns += reader.read_bytes(data, 500.0 + at_s + late_s)
    assert len(turns) == 39
    for number, turn in enumerate(turns[20:], start=20):
        degrees = 236.6 + 360 * number + np.degrees(turn.clockwise_rad)
        true_s = 500.0 + (degrees / 360) * 0.1
        error_s = turn.stamp_s - true_s
        assert abs(error_s - 0.005).max() < 0.008
        assert np.all(np.diff(turn.stamp_s) >= 0)
    assert reader.memory.relation.jitter_s is not None


def test_no_turn_has_the_lidar_s_own_time_for_the_host_s() -> None:
    """After 1.4 s without a look all comes in at once, its end from after a gap in which the buffer was full.

    The last packet, which alone tells the host's time, follows nothing: the turns before it have no time, and are none.
    """
    packets, reader = ld19_bytes(noisy_box(), 700), Ld19Reader(BAUD)
    for index, data in enumerate(packets[:120]):
        reader.read_bytes(data, 500.0 + index / 300)
    late = reader.read_bytes(b"".join(packets[150:260] + packets[690:692]), 501.9)
    after = [
        turn for index in range(200) for turn in reader.read_bytes(packets[260 + index], 502.0 + index / 300)
    ]
    assert late == []
    assert len(after) >= 4
    assert all(501.0 < turn.stamp_s[0] <= turn.stamp_s[-1] < 502.7 for turn in after)


def test_a_read_in_which_the_lidar_starts_again_has_no_turn_of_before() -> None:
    """Its clock begins at 5 s instead of 29.5 s, in the middle of a read: what ended before it has no time by it."""
    before, reader = ld19_bytes(noisy_box(), 330), Ld19Reader(BAUD)
    for index, data in enumerate(before[:120]):
        reader.read_bytes(data, 500.0 + index / 300)
    again = ld19_bytes(noisy_box(), 400, start_ms=15_000)
    turns = reader.read_bytes(b"".join(before[120:330] + again), 502.1)
    assert turns
    assert all(500.4 < turn.stamp_s[0] <= turn.stamp_s[-1] <= 502.1 for turn in turns)


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(1, 3000))
def test_chunks_make_no_difference(size: int) -> None:
    """The same angles and ranges, and the same counts, however the bytes are cut."""
    data = b"\x54\x2c\x00" + b"".join(ld19_bytes(noisy_box(), 90))
    whole, pieces = read([data]), read([data[at : at + size] for at in range(0, len(data), size)])
    assert whole[0].refused == pieces[0].refused
    assert len(whole[1]) == len(pieces[1]) == 1
    for one, other in zip(whole[1], pieces[1], strict=True):
        assert np.array_equal(one.clockwise_rad, other.clockwise_rad)
        assert np.array_equal(one.range_m, other.range_m)


def test_damaged_packets_leave_a_gap_and_no_wrong_beam() -> None:
    """Every tenth packet has a flipped bit: each turn is there with a tenth fewer beams, none of them elsewhere."""
    chunks = ld19_bytes(noisy_box(), 120)
    for index in range(5, 120, 10):
        chunks[index] = chunks[index][:20] + bytes([chunks[index][20] ^ 0x10]) + chunks[index][21:]
    reader, turns = read(chunks)
    assert len(turns) == 2
    assert all(390 <= len(turn.range_m) <= 414 for turn in turns)
    assert reader.refused["checksum"] == 12
    for turn in turns:
        ahead = turn.range_m[abs(np.degrees(turn.clockwise_rad) - 90) < 2]
        assert ahead == pytest.approx(np.ones(len(ahead)), abs=0.03)


def test_packets_that_come_twice_count_once() -> None:
    """Each packet, and then each read of five, comes twice: the same turns as without."""
    chunks = ld19_bytes(noisy_box(), 120)
    reader, turns = read([chunk + chunk for chunk in chunks])
    fives = [b"".join(chunks[at : at + 5]) for at in range(0, 120, 5)]
    again, others = read([five + five for five in fives])
    assert [len(turn.range_m) for turn in turns] == [len(turn.range_m) for turn in others] == [450, 450]
    assert reader.refused["repeated"] == 120
    assert again.refused["out_of_order"] + again.refused["repeated"] == 120


def test_after_a_gap_a_turn_is_not_patched_together() -> None:
    """Of four turns the second lacks 20 packets, more than half a turn: it and what is left of the third are dropped.

    The gap ends at 1083.4 degrees, just after the third zero mark.
    """
    chunks = ld19_bytes(noisy_box(), 200)
    assert len(read(chunks)[1]) == 4
    reader, turns = read(chunks[:80] + chunks[100:])
    assert [len(turn.range_m) for turn in turns] == [450, 450]
    assert not reader.refused


def test_of_a_turn_with_large_gaps_nothing_is_told() -> None:
    """Two packets of three are damaged."""
    chunks = [
        c if index % 3 == 0 else c[:-1] + b"\x00" for index, c in enumerate(ld19_bytes(noisy_box(), 120))
    ]
    reader, turns = read(chunks)
    assert turns == []
    assert reader.refused["incomplete"] >= 2


def test_a_lidar_that_starts_again_is_followed_after_half_a_second() -> None:
    """Its stamps begin anew elsewhere: 200 packets are held back, then turns come again, on the same host clock."""
    before, after = ld19_bytes(noisy_box(), 120), ld19_bytes(noisy_box(5), 300, start_ms=7_000)
    reader, turns = read(before + after)
    assert reader.refused["out_of_order"] == 199
    assert len(turns) == 2 + 2


def test_a_line_that_was_silent_begins_anew() -> None:
    """After 40 s, more than the stamps can tell, nothing of before is continued."""
    reader, chunks = Ld19Reader(BAUD), ld19_bytes(noisy_box(), 120)
    first = [turn for chunk in chunks for turn in reader.read_bytes(chunk, 100.0)]
    second = [turn for chunk in chunks for turn in reader.read_bytes(chunk, 140.0)]
    assert (len(first), len(second)) == (2, 2)
    assert all(turn.stamp_s.max() <= 140.0 and turn.stamp_s.min() > 139 for turn in second)


def test_a_motor_that_stands_still_makes_no_turn() -> None:
    """The same angles over and over, with stamps that go on."""
    reader = Ld19Reader(BAUD)
    turns = [
        turn for at_s, data in stalled_ld19_packets(2000) for turn in reader.read_bytes(data, 100.0 + at_s)
    ]
    assert turns == []
    assert reader.packets == 2000
    assert not reader.refused


@settings(max_examples=examples(30), deadline=None)
@given(st.binary(max_size=400), st.integers(0, 119), st.integers(0, 40))
def test_noise_and_cuts_never_make_a_beam_that_was_not_sent(noise: bytes, at: int, cut: int) -> None:
    """Whatever is put in or cut out: every range told is one that stands in the room at that angle."""
    data = ld19_bytes(noisy_box(), 120)
    chunks = [*data[:at], data[at][: len(data[at]) - cut], noise, *data[at + 1 :]]
    _, turns = read([b"".join(chunks)])
    for turn in turns:
        expected = np.minimum(
            2 / abs(np.cos(turn.clockwise_rad)), 1 / (abs(np.sin(turn.clockwise_rad)) + 1e-9)
        )
        assert abs(turn.range_m - expected).max() < 0.04
