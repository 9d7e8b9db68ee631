"""Encoder decoding: wraps, signs, windows, and the refusal of impossible jumps."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.motion import encoder
from chefbotd.motion.encoder import EncoderParameters, EncodersState, Reading
from tests.budget import examples

PERIOD_S = 0.02
FORWARD = (1, 1)
Counts = tuple[int, ...]


def parameters(**changes: float) -> EncoderParameters:
    """1000 counts a turn, at most 10 turns a second: 200 counts in 20 ms, and no slack."""
    values = {"counts_per_turn": 1000.0, "max_speed_rad_s": 10 * math.tau, "tolerance_counts": 0} | changes
    return EncoderParameters.model_validate(values)


def feed(
    params: EncoderParameters, *frames: Counts, signs: Counts = FORWARD, state: EncodersState = encoder.START
) -> tuple[EncodersState, list[Reading]]:
    """Decode frames that come one period apart, after those of ``state``."""
    start_s = 0.0 if state.base is None else state.base.board_s + PERIOD_S
    readings = []
    for number, counts in enumerate(frames):
        state, reading = encoder.decode(params, signs, state, counts, start_s + number * PERIOD_S)
        readings.append(reading)
    return state, readings


def turns(*parts: float) -> object:
    """About so many turns per wheel."""
    return pytest.approx(tuple(part * math.tau for part in parts))


def test_the_first_reading_is_the_reference() -> None:
    """Whatever the counters stand at when the link opens, the wheels have not moved yet."""
    _, (first,) = feed(parameters(), (123_456, -98))
    assert first == Reading((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), rebased=True)


def test_counts_become_angles_and_speeds() -> None:
    """100 and -50 counts of 1000 in 20 ms: a tenth and a twentieth of a turn, 5 and -2.5 turns a second."""
    _, (_, reading) = feed(parameters(), (7, 7), (107, -43))
    assert reading.travel_rad == turns(0.1, -0.05)
    assert reading.position_rad == turns(0.1, -0.05)
    assert reading.velocity_rad_s == turns(5, -2.5)
    assert not reading.refused


def test_a_rate_from_the_edges_is_the_velocity() -> None:
    """500 and 2 counts/s of 1000 a turn, the left encoder turned round: -0.5 and 0 turns a second (threshold 0.02)."""
    params = parameters(standstill_rad_s=0.02)
    state, _ = feed(params, (0, 0))
    _, reading = encoder.decode(params, (-1, 1), state, (-10, 0), PERIOD_S, (500.0, 2.0))
    assert reading.travel_rad == turns(0.01, 0)
    assert reading.velocity_rad_s == (pytest.approx(-math.pi), 0.0)


def test_a_sign_turns_an_encoder_round() -> None:
    """With -1 for the left wheel its falling count is forward."""
    _, (_, reading) = feed(parameters(), (0, 0), (-100, 100), signs=(-1, 1))
    assert reading.position_rad == turns(0.1, 0.1)


@pytest.mark.parametrize("width_bits", [16, 32])
def test_counters_wrap_at_their_width(width_bits: int) -> None:
    """From 30 below the top to 20 above the bottom is 50 counts forward, and back again."""
    half = 1 << (width_bits - 1)
    frames = ((half - 30, -half + 20), (-half + 20, half - 30), (half - 30, -half + 20))
    _, (_, there, back) = feed(parameters(width_bits=width_bits), *frames)
    assert there.travel_rad == turns(0.05, -0.05)
    assert back.position_rad == (0.0, 0.0)


def test_unsigned_counters_wrap_too() -> None:
    """A 16-bit counter that is sent as 0 to 65535 needs no other setting."""
    _, (_, reading) = feed(parameters(width_bits=16), (65_530, 5), (4, 65_531))
    assert reading.travel_rad == turns(0.01, -0.01)


def test_four_wheels_are_decoded_alike() -> None:
    """Every tuple is as long as the wheels are many, in their order."""
    _, (_, reading) = feed(parameters(), (0, 0, 0, 0), (10, 20, 30, 40), signs=(1, -1, 1, -1))
    assert reading.travel_rad == turns(0.01, -0.02, 0.03, -0.04)


def test_velocity_is_the_mean_over_the_window() -> None:
    """With three readings: (10 + 30) counts in 40 ms are 1 turn a second, then (30 + 50) are 2."""
    _, readings = feed(parameters(velocity_window=3), (0, 0), (10, 10), (40, 40), (90, 90))
    assert [reading.velocity_rad_s[0] / math.tau for reading in readings] == pytest.approx([0, 0.5, 1, 2])


def test_a_wheel_slower_than_the_threshold_stands() -> None:
    """One count in 20 ms is 0.05 turns a second: zero below a threshold of 0.1, although its travel counts."""
    _, (_, reading) = feed(parameters(standstill_rad_s=0.1 * math.tau), (0, 0), (1, 10))
    assert reading.velocity_rad_s == turns(0, 0.5)
    assert reading.travel_rad == turns(0.001, 0.01)


def test_the_same_board_time_twice_divides_nothing_by_zero() -> None:
    """A reading with the stamp of the last replaces it: travel counts, the velocity spans real time."""
    params = parameters(tolerance_counts=10)
    state, _ = feed(params, (0, 0), (20, 20))
    _, again = encoder.decode(params, FORWARD, state, (30, 30), PERIOD_S)
    assert again.travel_rad == turns(0.01, 0.01)
    assert again.velocity_rad_s == turns(1.5, 1.5)


def test_board_time_that_goes_back_starts_a_new_window() -> None:
    """No speed is computed over a span that runs backwards."""
    params = parameters(tolerance_counts=10)
    state, _ = feed(params, (0, 0), (20, 20))
    _, back = encoder.decode(params, FORWARD, state, (25, 25), -1.0)
    assert back.velocity_rad_s == (0.0, 0.0)
    assert back.travel_rad == turns(0.005, 0.005)


def test_the_fastest_possible_change_is_believed_and_one_more_is_not() -> None:
    """200 counts in 20 ms are 10 turns a second, the limit, and 201 are too many; slack adds to it."""
    _, (_, most) = feed(parameters(max_speed_rad_s=10.0001 * math.tau), (0, 0), (200, -200))
    _, (_, more) = feed(parameters(max_speed_rad_s=10.0001 * math.tau), (0, 0), (200, -201))
    _, (_, slack) = feed(
        parameters(max_speed_rad_s=10.0001 * math.tau, tolerance_counts=1), (0, 0), (200, -201)
    )
    assert (most.refused, more.refused, slack.refused) == (False, True, False)


def test_a_number_that_lost_digits_moves_no_wheel() -> None:
    """The right wheel's 12500 arrives as 125: refused for both wheels, and caught up by the next frame."""
    frames = ((12_300, 12_300), (12_400, 12_400), (12_500, 125), (12_600, 12_600))
    _, (_, good, refused, next_good) = feed(parameters(), *frames)
    assert refused.jumped == (1,)
    assert refused.travel_rad == (0.0, 0.0)
    assert refused.position_rad == good.position_rad
    assert refused.velocity_rad_s == good.velocity_rad_s
    assert next_good.travel_rad == turns(0.2, 0.2)
    assert next_good.velocity_rad_s == turns(5, 5)


def test_time_spent_refusing_allows_more_travel() -> None:
    """After a second of silence 9000 counts are nine turns in a second: possible."""
    state, _ = feed(parameters(), (0, 0))
    _, reading = encoder.decode(parameters(), FORWARD, state, (9000, 9000), 1.0)
    assert reading.travel_rad == turns(9, 9)


def test_counters_that_have_moved_are_a_new_reference() -> None:
    """Three refused readings that agree re-base there, without travel; the next counts from there."""
    frames = ((0, 0), (5000, 5000), (5010, 5010), (5020, 5020), (5030, 5030))
    _, (_, *refused, after) = feed(parameters(), *frames)
    assert [reading.refused for reading in refused] == [True, True, True]
    assert [reading.rebased for reading in refused] == [False, False, True]
    assert after.travel_rad == after.position_rad == turns(0.01, 0.01)
    assert after.velocity_rad_s == turns(0.5, 0.5)
    assert not after.refused


def test_refused_readings_that_disagree_are_never_believed() -> None:
    """Noise far from the counters and far from itself is refused for as long as it lasts."""
    noise = [(n % 2 * 40_000 + 20_000, 10) for n in range(1, 9)]
    state, readings = feed(parameters(), (0, 0), *noise)
    assert all(reading.refused and not reading.rebased for reading in readings[1:])
    _, (good,) = feed(parameters(), (20, 20), state=state)
    assert good.travel_rad == turns(0.02, 0.02)


def test_a_good_reading_forgets_the_suspects() -> None:
    """Refusals count towards a new reference only in a row."""
    frames = ((0, 0), (5000, 0), (5000, 0), (10, 0), (5000, 0), (5000, 0), (20, 0))
    _, readings = feed(parameters(), *frames)
    assert not any(reading.rebased for reading in readings[1:])
    assert readings[-1].position_rad == turns(0.02, 0)


def test_one_confirmation_follows_every_jump() -> None:
    """With ``confirmations`` of one the first impossible reading is the new reference."""
    _, (_, jump, after) = feed(parameters(confirmations=1), (0, 0), (5000, 0), (5010, 10))
    assert jump.rebased
    assert after.travel_rad == turns(0.01, 0.01)


def surprised(*frames: Counts) -> list[Reading]:
    """Readings after those of a steady turn a second (20 counts a frame).

    12.5 turns/s² over a window of 60 ms and a frame of 20 ms are 12.5 * 0.02 * 0.08 / 2 = 0.01 turns, or 10 counts.
    """
    steady = ((0, 0), (20, 20), (40, 40), (60, 60))
    _, readings = feed(parameters(max_acceleration_rad_s2=12.5 * math.tau), *steady, *frames)
    return readings[len(steady) :]


def test_a_possible_change_that_surprises_waits_for_the_next() -> None:
    """80 arrives as 180, possible but 100 counts off: not believed; the next is, with the travel of both."""
    wrong, good = surprised((80, 180), (100, 100))
    assert (wrong.refused, wrong.unconfirmed, wrong.jumped) == (True, True, ())
    assert wrong.travel_rad == (0.0, 0.0)
    assert not good.refused
    assert good.travel_rad == turns(0.04, 0.04)


def test_a_surprise_that_the_next_reading_bears_out_is_believed() -> None:
    """A wheel that was kicked to 120 counts a frame is a frame late and loses nothing."""
    first, second = surprised((80, 180), (100, 300))
    assert first.unconfirmed
    assert not second.refused
    assert second.travel_rad == turns(0.04, 0.24)


def test_surprises_never_move_the_counters() -> None:
    """However many in a row disagree with each other, none becomes a new reference."""
    readings = surprised((80, 180), (100, -120), (120, 260), (140, -150), (160, 160))
    assert [reading.rebased for reading in readings] == [False] * 5
    assert readings[-1].position_rad == turns(0.16, 0.16)


def test_a_small_change_of_course_is_no_surprise() -> None:
    """Nine counts off are within the limit and eleven are not."""
    (within,), (beyond,) = surprised((80, 89)), surprised((80, 91))
    assert (within.refused, beyond.refused) == (False, True)


@pytest.mark.parametrize(
    ("elapsed_s", "allowed_counts"),
    [(0.04, 30), (0.06, 30), (0.29, 30), (0.31, 755)],
    ids=["one line lost", "two", "many", "a pause of the board"],
)
def test_lost_lines_excuse_no_more_than_one_of_them(elapsed_s: float, allowed_counts: int) -> None:
    """Two cycles: 12.5 * 0.04 * (0.08 + 0.04) / 2 = 0.03 turns; a pause of 0.31 s: 12.5 * 0.31 * 0.39 / 2 = 0.7556."""
    params = parameters(max_acceleration_rad_s2=12.5 * math.tau, max_speed_rad_s=50 * math.tau)
    state, _ = feed(params, *[(count, count) for count in range(0, 121, 20)])
    expected = 120 + round(1000 * elapsed_s)
    for off, refused in ((allowed_counts - 1, False), (allowed_counts + 1, True)):
        _, reading = encoder.decode(params, FORWARD, state, (expected, expected - off), 0.12 + elapsed_s)
        assert reading.unconfirmed == refused


def test_earlier_gaps_excuse_no_more() -> None:
    """Cycles of 20, 80 and 20 ms: a later gap counts as two of 20 ms, 12.5 * 0.04 * (0.12 + 0.04) / 2 = 0.04 turns."""
    params, state = parameters(max_acceleration_rad_s2=12.5 * math.tau), encoder.START
    for board_s in (0.0, 0.02, 0.1, 0.12):
        state, _ = encoder.decode(params, FORWARD, state, (7, 7), board_s)
    for off, refused in ((39, False), (41, True)):
        _, reading = encoder.decode(params, FORWARD, state, (7, 7 - off), 0.2)
        assert reading.unconfirmed == refused


def test_a_board_reset_does_not_move_the_robot() -> None:
    """After ``rebase`` the counters may start at zero again: positions go on from where they were."""
    state, _ = feed(parameters(), (400, 400), (500, 450))
    _, (reference, reading) = feed(parameters(), (0, 0), (10, 20), state=encoder.rebase(state))
    assert reference.travel_rad == (0.0, 0.0)
    assert reference.rebased
    assert reference.position_rad == turns(0.1, 0.05)
    assert reading.position_rad == turns(0.11, 0.07)


@given(
    st.lists(st.tuples(st.integers(-200, 200), st.integers(-200, 200)), max_size=60),
    st.sampled_from([8, 16, 32]),
)
@settings(max_examples=examples(60))
def test_no_count_is_ever_lost(steps: list[tuple[int, int]], width_bits: int) -> None:
    """Any possible motion, through any number of wraps, ends at exactly the counts that were turned."""
    params = parameters(
        width_bits=width_bits, max_speed_rad_s=3 * math.tau
    )  # 60 counts: less than half of 8 bits
    left = right = 0
    frames = [(0, 0)]
    for left_step, right_step in steps:
        left, right = left + left_step % 60, right - right_step % 60
        frames.append((left % (1 << width_bits), right % (1 << width_bits)))
    _, readings = feed(params, *frames)
    assert not any(reading.refused for reading in readings)
    assert readings[-1].position_rad == (left * (math.tau / 1000), right * (math.tau / 1000))
    assert math.fsum(r.travel_rad[0] for r in readings) == pytest.approx(readings[-1].position_rad[0])


@given(st.lists(st.booleans(), min_size=1, max_size=40))
@settings(max_examples=examples(60))
def test_corruption_never_shifts_the_odometry(corrupted: list[bool]) -> None:
    """Frames garbled at random, with good ones after them, leave the position as if none had been garbled."""
    frames = [(0, 0)]
    for number, bad in enumerate(corrupted, start=1):
        frames.append((number * 50, 500_000 + number * 100_000) if bad else (number * 50, number * 50))
    frames.append((len(frames) * 50,) * 2)
    _, readings = feed(parameters(), *frames)
    assert [reading.refused for reading in readings] == [False, *corrupted, False]
    assert readings[-1].position_rad == (frames[-1][0] * (math.tau / 1000),) * 2


def test_a_frame_for_other_wheels_is_a_bug() -> None:
    """Three counts for two wheels raise, at the reference and afterwards."""
    with pytest.raises(ValueError, match="expected 2 counts"):
        feed(parameters(), (1, 2, 3))
    with pytest.raises(ValueError, match="longer"):
        feed(parameters(), (1, 2), (1, 2, 3))


@pytest.mark.parametrize(
    "changes",
    [
        {"width_bits": 7},
        {"width_bits": 65},
        {"velocity_window": 1},
        {"confirmations": 0},
        {"counts_per_turn": 0},
    ],
)
def test_parameters_out_of_range_are_refused(changes: dict[str, float]) -> None:
    """The bad value is named."""
    with pytest.raises(ValidationError, match=next(iter(changes))):
        parameters(**changes)


def test_after_too_long_a_gap_a_narrow_counter_is_a_new_reference() -> None:
    """10 turns/s of 1000 counts go half round 16 bits in 3.28 s: 42,000 counts after 5 s are not read as -23,536."""
    params = parameters(width_bits=16)
    state, _ = feed(params, (0, 0), (20, 20))
    state, after_gap = encoder.decode(params, FORWARD, state, (42_020 - 65_536, 20), 5.02)
    assert (after_gap.rebased, after_gap.refused) == (True, False)
    assert after_gap.travel_rad == (0.0, 0.0)
    assert after_gap.position_rad == turns(0.02, 0.02)


@pytest.mark.parametrize("delta", [20_000, -20_000])
def test_more_than_a_quarter_of_the_counter_is_still_travel(delta: int) -> None:
    """2.5 s after the last reading a wheel may have gone 25,000 of a 16-bit counter's 32,768 either way."""
    params = parameters(width_bits=16)
    state, _ = feed(params, (30_000, 5))
    after = (30_000 + delta + 32_768) % 65_536 - 32_768
    _, reading = encoder.decode(params, FORWARD, state, (after, 5), 2.5)
    assert not reading.rebased
    assert reading.travel_rad == turns(delta / 1000, 0.0)


def test_only_who_went_too_far_is_to_blame() -> None:
    """Without time between them four counts of slack are all: four of the left wheel are well, five of the right not."""
    params = parameters(tolerance_counts=4)
    state, _ = feed(params, (0, 0))
    _, reading = encoder.decode(params, FORWARD, state, (-4, 5), 0.0)
    assert reading.jumped == (1,)


def narrow(count: int, *, signed: bool) -> int:
    """A count as a counter of 16 bits shows it."""
    return (count + 2**15) % 2**16 - 2**15 if signed else count % 2**16


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize("direction", [1, -1])
def test_counters_of_16_bits_are_recognised_at_their_second_wrap(signed: bool, direction: int) -> None:
    """100 counts a frame, round and round: the first wrap loses the travel of three frames, those after it nothing."""
    params = parameters(width_bits=32)
    frames = [direction * 100 * number for number in range(3000)]
    state, recognised = encoder.START, []
    for number, count in enumerate(frames):
        shown = narrow(count + 32000, signed=signed), narrow(count, signed=signed)
        state, reading = encoder.decode(params, (1, 1), state, shown, number * 0.05)
        if reading.recognised_narrow:
            recognised.append(number)
    assert len(recognised) == 1
    assert [abs(total - frames[-1]) for total in state.totals] == [300, 300]


def test_a_board_that_restarts_has_no_narrow_counters() -> None:
    """Its counters fall from anywhere to 0 and near it, again and again: 32 bits stay 32 bits."""
    params, state = parameters(width_bits=32), encoder.START
    for start in (5_000, 40_000, 1_000, 33_000, 60_000):
        for frame, count in enumerate((start, start + 100, start + 200, 0, 100, 200, 300)):
            state, reading = encoder.decode(params, (1, 1), state, (count, count), frame * 0.05 + start)
            assert not reading.recognised_narrow
    assert state.narrow_wraps == 0


def test_damaged_numbers_are_no_wraps() -> None:
    """Single readings that lost digits are refused; none is taken for a wrap."""
    params, state = parameters(width_bits=32), encoder.START
    for number in range(1, 400):
        count = 20_000 + 50 * number
        shown = count if number % 7 else count // 10
        state, reading = encoder.decode(params, (1, 1), state, (count, shown), number * 0.05)
        assert not reading.recognised_narrow
    assert state.narrow_wraps == 0
    assert state.totals == (50 * 397, 50 * 397)  # from the first frame to the last good one
