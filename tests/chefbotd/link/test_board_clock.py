"""The board's clock."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.link.board_clock import BoardClock, ClockRelation, StampVerdict
from tests.budget import examples

WRAP = 2**32


def run(
    clock: BoardClock, start_micros: int, cycles: int, *, cycle_s: float = 0.02, host_s: float = 100.0
) -> float:
    """So many regular cycles; returns the host time after the last."""
    for number in range(cycles):
        micros = (start_micros + round(number * cycle_s * 1e6)) % WRAP
        assert clock.observe(micros, cycle_s, host_s + number * cycle_s) is StampVerdict.GOOD
    return host_s + (cycles - 1) * cycle_s


def test_board_time_advances_by_the_boards_own_microseconds():
    """Fifty cycles of 20 ms by the board are 1 s, however unevenly they arrive at the host."""
    clock = BoardClock()
    rng = random.Random(1)
    first = None
    for number in range(51):
        clock.observe(1_000_000 + number * 20_000, 0.02, 100.0 + number * 0.02 + rng.uniform(0, 0.015))
        first = first if first is not None else clock.latest_s
    assert clock.latest_s - first == pytest.approx(1.0, abs=1e-9)


def test_the_counter_wraps_without_a_jump():
    """A run over 2^32 microseconds is as long as any other."""
    clock = BoardClock()
    run(clock, WRAP - 500_000, 51, host_s=100.0)
    assert clock.latest_s == pytest.approx(101.0, abs=1e-6)


def test_cycles_lost_on_the_wire_are_bridged_by_the_host_clock():
    """Four lost lines: the step of 100 ms disagrees with the line's own 20 ms but not with the host's 100 ms."""
    clock = BoardClock()
    host_s = run(clock, 0, 10)
    before = clock.latest_s
    assert clock.observe(9 * 20_000 + 100_000, 0.02, host_s + 0.1) is StampVerdict.GOOD
    assert clock.latest_s - before == pytest.approx(0.1)


def test_a_replay_faster_than_real_time_is_believed():
    """50 ms cycles arriving every millisecond agree with their own second field."""
    clock = BoardClock()
    for number in range(100):
        assert clock.observe(number * 50_000, 0.05, 100.0 + number * 0.001) is StampVerdict.GOOD
    assert clock.latest_s == pytest.approx(100.0 + 99 * 0.05)


def test_one_damaged_reading_is_left_out():
    """A line whose microseconds lost digits puts the clock in doubt for one cycle and changes nothing."""
    clock = BoardClock()
    host_s = run(clock, 5_000_000, 10)
    before = clock.latest_s
    assert clock.observe(518, 0.02, host_s + 0.02) is StampVerdict.SUSPECT
    assert clock.in_doubt
    assert clock.latest_s == before
    assert clock.observe(5_000_000 + 11 * 20_000, 0.02, host_s + 0.04) is StampVerdict.GOOD
    assert not clock.in_doubt
    assert clock.latest_s - before == pytest.approx(0.04)
    assert clock.suspects == 1


def test_two_agreeing_readings_near_zero_are_a_restart():
    """The board restarted without a banner being seen: the second new reading tells, and board time goes on."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    before = clock.latest_s
    assert clock.observe(800_000, 0.02, host_s + 1.5) is StampVerdict.SUSPECT
    assert clock.observe(820_000, 0.02, host_s + 1.52) is StampVerdict.RESTARTED
    assert clock.latest_s - before == pytest.approx(1.52)


def test_two_agreeing_readings_a_little_ahead_are_a_gap():
    """After a pause that nobody timed the clock goes on by what the board says, without a restart."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    before = clock.latest_s
    ahead = 50_000_000 + 9 * 20_000 + 3_000_000
    assert clock.observe(ahead, 0.02, host_s + 0.01) is StampVerdict.SUSPECT
    assert clock.observe(ahead + 20_000, 0.02, host_s + 0.011) is StampVerdict.RESYNCED
    assert clock.latest_s - before == pytest.approx(3.02)


def test_a_reading_damaged_forwards_makes_no_restart():
    """5 s after boot one line is damaged in both numbers and passes; the next two are behind it: resynced, time goes on.

    A board that had restarted in those 40 ms could show 40 ms and the slack at most, not 5 s.
    """
    clock = BoardClock()
    host_s = run(clock, 5_000_000, 10)
    before = clock.latest_s
    assert clock.observe(5_180_000 + 90_000, 0.09, host_s + 0.02) is StampVerdict.GOOD
    assert clock.observe(5_220_000, 0.02, host_s + 0.04) is StampVerdict.SUSPECT
    assert clock.observe(5_240_000, 0.02, host_s + 0.06) is StampVerdict.RESYNCED
    assert clock.latest_s - before == pytest.approx(0.09 + 0.04)


def test_two_readings_that_lost_the_same_digit_make_no_restart():
    """9.17 s becomes 0.97 s twice in a row: too much for a board that has been running for 40 ms."""
    clock = BoardClock()
    host_s = run(clock, 9_150_065, 2)
    assert clock.observe(949_065, 0.02, host_s + 0.02) is StampVerdict.SUSPECT
    assert clock.observe(969_065, 0.02, host_s + 0.04) is StampVerdict.RESYNCED


def test_a_reading_50_ms_off_is_not_excused_by_the_host():
    """Neither the line's own 20 ms nor the host's 20 ms allow a step of 70 ms: it waits for the next reading."""
    clock = BoardClock()
    host_s = run(clock, 5_000_000, 10)
    assert clock.observe(5_000_000 + 9 * 20_000 + 70_000, 0.02, host_s + 0.02) is StampVerdict.SUSPECT


@pytest.mark.parametrize(
    ("up_s", "out_s", "back_s"),
    [(3.7, 14.0, 9.0), (1.0, 12.5, 12.3), (3.7, 14.0, 2.0)],
    ids=["a little ahead", "nearly what the host saw", "behind"],
)
def test_a_power_cycle_is_a_restart_wherever_the_counter_stands(up_s: float, out_s: float, back_s: float):
    """Cable and power were out: the new uptime is less than the host waited, and not what it would be had it run on."""
    clock = BoardClock()
    host_s = run(clock, round(up_s * 1e6) - 180_000, 10)
    before = clock.latest_s
    assert clock.observe(round(back_s * 1e6), 0.02, host_s + out_s) is StampVerdict.SUSPECT
    assert clock.observe(round(back_s * 1e6) + 20_000, 0.02, host_s + out_s + 0.02) is StampVerdict.RESTARTED
    assert clock.latest_s - before == pytest.approx(out_s + 0.02)


def test_a_board_that_ran_on_while_the_cable_was_out_is_no_restart():
    """Up for 3.7 s, unplugged for 12 s, back at 15.7 s: it has been counting all the time."""
    clock = BoardClock()
    host_s = run(clock, 3_700_000 - 180_000, 10)
    assert clock.observe(15_705_000, 0.02, host_s + 12.0) is StampVerdict.GOOD


def test_a_long_gap_read_late_is_no_restart():
    """Up for 3.7 s, silent for 1 s, then read 60 ms late twice: 4.7 s of uptime cannot have begun in that second."""
    clock = BoardClock()
    host_s = run(clock, 3_700_000 - 180_000, 10)
    assert clock.observe(4_700_000, 0.02, host_s + 1.06) is StampVerdict.SUSPECT
    assert clock.observe(4_720_000, 0.02, host_s + 1.08) is StampVerdict.RESYNCED


def test_a_leap_far_ahead_is_no_restart():
    """Microseconds an hour ahead, confirmed: the clock moved, the board did not restart; host time bridges."""
    clock = BoardClock()
    host_s = run(clock, 0, 10)
    before = clock.latest_s
    assert clock.observe(3_000_000_000, 0.02, host_s + 0.02) is StampVerdict.SUSPECT
    assert clock.observe(3_000_020_000, 0.02, host_s + 0.04) is StampVerdict.RESYNCED
    assert clock.latest_s - before == pytest.approx(0.04)


def test_after_a_banner_the_next_reading_counts():
    """Told of the restart, the clock takes the next reading as its new beginning, at once."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    clock.expect_new_count()
    assert clock.latest_s is None
    assert clock.observe(20_000, 0.02, host_s + 2.0) is StampVerdict.GOOD
    assert clock.latest_s == pytest.approx(host_s + 2.0)


def test_without_a_reading_board_time_is_host_time():
    """Boards that never send `t` are timed by the host."""
    assert BoardClock().board_s(7.0) == 7.0


def test_between_readings_host_time_fills_in():
    """30 ms after a reading, board time is 30 ms later; it never goes back."""
    clock = BoardClock()
    host_s = run(clock, 0, 10)
    assert clock.board_s(host_s + 0.03) - clock.latest_s == pytest.approx(0.03)
    assert clock.board_s(host_s - 0.03) == clock.latest_s


def test_skew_and_offset_are_found_through_jitter():
    """A board whose seconds are 80 ppm shorter, read with up to 2 ms of delay: the fit finds 80 ppm within 20."""
    relation, rng = ClockRelation(), random.Random(3)
    for number in range(6000):
        board_s = 50.0 + number * 0.02
        relation.observe(board_s, 1000.0 + board_s * (1 + 80e-6) + rng.uniform(0, 0.002))
    assert relation.skew_ppm == pytest.approx(80, abs=20)
    assert relation.jitter_s == pytest.approx(0.0005, abs=0.0001)  # mean distance from the middle of 2 ms
    assert relation.host_s(170.0) == pytest.approx(1000.0 + 170.0 * (1 + 80e-6) + 0.001, abs=0.0005)


def test_late_readings_do_not_bend_the_line():
    """One reading in twenty waits 50 ms in a buffer: all of them are left out and the line stays."""
    relation = ClockRelation()
    for number in range(2000):
        late_s = 0.05 if number % 20 == 19 else 0.0
        relation.observe(number * 0.02, number * 0.02 + 1000.0 + late_s)
    assert relation.excluded == 100
    assert relation.host_s(40.0) == pytest.approx(1040.0, abs=1e-6)


def test_a_clock_that_really_moved_is_followed():
    """The host slept for 10 s: after fifty readings that do not fit, the fit starts afresh."""
    relation = ClockRelation()
    for number in range(500):
        relation.observe(number * 0.02, number * 0.02)
    for number in range(500, 800):
        relation.observe(number * 0.02, number * 0.02 + 10.0)
    assert relation.host_s(16.0) == pytest.approx(26.0, abs=1e-6)


def test_too_few_readings_tell_no_skew():
    """Before there is a line there is no skew and no jitter, and host time is a guess."""
    relation = ClockRelation()
    assert (relation.skew_ppm, relation.jitter_s, relation.host_s(3.0)) == (None, None, 3.0)


def test_a_clock_that_warms_up_is_followed_and_its_past_forgotten():
    """0 ppm for two minutes, then 20 ppm: after two time constants of it (4 min), what was before weighs e^-2.

    With nothing forgotten the line would still be a third off, at 15 ppm.
    """
    relation, rng, host_s = ClockRelation(), random.Random(5), 1000.0
    for number in range(3600):
        host_s += 0.1 * (1.0 if number < 1200 else 1.0 + 20e-6)
        relation.observe(50.0 + number * 0.1, host_s + rng.uniform(0.0, 0.002))
    assert relation.excluded == 0
    assert relation.skew_ppm == pytest.approx(20, abs=3)


@pytest.mark.parametrize("last_micros", [5_000_000, 20_000, WRAP - 20_000])
@pytest.mark.parametrize("ahead_s", [0.0, 0.03, -0.03, 1800.0, -1800.0])
def test_another_reading_of_the_counter_has_its_board_time(last_micros: int, ahead_s: float):
    """Before or after the last `t` line, up to half of the counter's 71.6 minutes, also where it wraps in between."""
    clock = BoardClock()
    assert clock.time_of_s(last_micros) is None
    run(clock, (last_micros - 9 * 20_000) % WRAP, 10)
    micros = (last_micros + round(ahead_s * 1e6)) % WRAP
    assert clock.time_of_s(micros) == pytest.approx(clock.latest_s + ahead_s, abs=1e-6)


def test_a_reading_is_stamped_with_the_hosts_time_of_its_measurement():
    """A board that is 150 ppm slow, its lines 1 to 3 ms on their way: one of 41 ms is stamped 2 ms after its cycle."""
    clock, rng = BoardClock(), random.Random(4)
    for number in range(3000):
        made_s = 100.0 + number * 0.02
        clock.observe(
            700_000 + round(number * 20_000 * (1 - 150e-6)), 0.02, made_s + rng.uniform(0.001, 0.003)
        )
    made_s = 100.0 + 3000 * 0.02
    clock.observe(700_000 + round(3000 * 20_000 * (1 - 150e-6)), 0.02, made_s + 0.041)
    assert clock.stamp_s == pytest.approx(made_s + 0.002, abs=3e-4)
    assert clock.late_s == pytest.approx(0.039, abs=3e-4)


def test_a_reading_in_doubt_is_not_late():
    """Nobody knows when it was made: what comes with it is stamped as it is read."""
    clock = BoardClock()
    host_s = run(clock, 5_000_000, 60)
    assert clock.observe(5_000_000 + 60 * 20_000, 0.02, host_s + 0.045) is StampVerdict.GOOD
    assert clock.late_s == pytest.approx(0.025)
    assert clock.observe(518, 0.02, host_s + 0.06) is StampVerdict.SUSPECT
    assert clock.late_s == 0.0


@given(
    st.lists(st.tuples(st.floats(0.0, 0.3), st.integers(-3, 3)), min_size=2, max_size=60),
    st.floats(-300e-6, 300e-6),
)
@settings(max_examples=examples(200))
def test_stamps_never_go_back_and_never_lie_after_the_reading(lines: list[tuple[float, int]], skew: float):
    """However late lines are read, whichever are lost, restart or are damaged, and however the clocks differ."""
    clock, made_s, read_s, micros, before_s = BoardClock(), 100.0, 0.0, 1_000_000, float("-inf")
    for late_s, odd in lines:
        made_s, micros = made_s + 0.02, micros + round(20_000 * (1 + skew))
        micros = {-3: 300, 3: 91_234_567}.get(odd, micros)
        read_s = max(read_s, made_s + late_s)
        clock.observe(micros, 0.02, read_s)
        assert before_s <= clock.stamp_s <= read_s
        assert clock.late_s >= 0.0
        before_s = clock.stamp_s


def test_a_leap_of_exactly_ten_seconds_is_still_a_gap():
    """Two readings agree 9.98 and 10 s ahead while the host saw 11 ms pass: board time goes on by 10 s, not by 11 ms."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    before, last = clock.latest_s, 50_000_000 + 9 * 20_000
    assert clock.observe(last + 9_980_000, 0.02, host_s + 0.01) is StampVerdict.SUSPECT
    assert clock.observe(last + 10_000_000, 0.02, host_s + 0.011) is StampVerdict.RESYNCED
    assert clock.latest_s - before == pytest.approx(10.0)


def test_a_leap_of_half_a_second_more_is_none():
    """10.5 s ahead within 11 ms: two readings were damaged alike, and board time goes on by what the host saw pass."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    before, last = clock.latest_s, 50_000_000 + 9 * 20_000
    assert clock.observe(last + 10_480_000, 0.02, host_s + 0.01) is StampVerdict.SUSPECT
    assert clock.observe(last + 10_500_000, 0.02, host_s + 0.011) is StampVerdict.RESYNCED
    assert clock.latest_s - before == pytest.approx(0.011)


def test_a_line_that_comes_twice_is_in_doubt():
    """The same microseconds again: no cycle of 20 ms has passed between two of them."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    assert clock.observe(50_000_000 + 9 * 20_000, 0.02, host_s) is StampVerdict.SUSPECT


def test_a_banner_ends_a_doubt():
    """What disagreed was of the run before, or the first of the new one: no reading waits for another any more."""
    clock = BoardClock()
    host_s = run(clock, 50_000_000, 10)
    assert clock.observe(518, 0.02, host_s + 0.02) is StampVerdict.SUSPECT
    clock.expect_new_count()
    assert not clock.in_doubt


def test_the_scatter_is_known_from_the_third_reading_on():
    """Even readings but for the third, 10 ms late; the first residual counts half: 5 ms."""
    relation = ClockRelation()
    for board_s, host_s in ((0.0, 7.0), (0.1, 7.1), (0.2, 7.21)):
        relation.observe(board_s, host_s)
    assert relation.jitter_s == pytest.approx(0.005, rel=1e-3)


def test_clocks_that_have_parted_are_related_anew_by_the_reading_that_showed_it():
    """The board's clock runs from 3.5 s on at the host's 100 s; then all is read 0.7 s later, for fifty readings."""
    relation = ClockRelation()
    for index in range(40):
        relation.observe(3.5 + index * 0.05, 100.0 + index * 0.05)
    told_s = []
    for index in range(40, 100):
        relation.observe(3.5 + index * 0.05, 100.7 + index * 0.05)
        told_s.append(relation.host_s(3.5 + index * 0.05) - index * 0.05)
    assert told_s[0] == pytest.approx(100.0, abs=0.01)
    assert told_s[-1] == pytest.approx(100.7, abs=0.01)
    assert min(told_s) > 99.9
