"""The times of encoder lines that share a read."""

import math
import random
from itertools import pairwise

import pytest

from chefbotd.link.board_clock import CycleClock

CYCLE_S = 1 / 290


def stamps(read_every_s: float, seconds: float = 2.0) -> list[tuple[float, float]]:
    """When each line was printed, and when the host read it, all lines of an interval at its end."""
    reads = round(seconds / read_every_s)
    found, number = [], 1
    for read in range(1, reads + 1):
        while number * CYCLE_S <= read * read_every_s:
            found.append((number * CYCLE_S, 100.0 + read * read_every_s))
            number += 1
    return found


@pytest.mark.parametrize("read_every_s", [0.004, 0.011, 0.016, 0.023])
def test_lines_of_a_read_are_spread_by_a_cycle(read_every_s: float):
    """290 lines a second, read several at once: after half a second each follows by its cycle, within a quarter."""
    clock = CycleClock()
    told = [clock.observe(host_s) for _, host_s in stamps(read_every_s)]
    steps = [after - before for before, after in pairwise(told[150:])]
    assert min(steps) > 0.75 * CYCLE_S
    assert max(steps) < 1.25 * CYCLE_S


def test_the_lines_stay_with_the_hosts_time():
    """After two seconds they are where the host reads them, within a read's length."""
    clock = CycleClock()
    found = stamps(0.016)
    told = [clock.observe(host_s) for _, host_s in found]
    assert told[-1] == pytest.approx(found[-1][1], abs=0.016)


def test_a_pause_is_a_pause():
    """A board that is silent for a second: the next line is a second later, and lines go on increasing."""
    clock = CycleClock()
    before = [clock.observe(host_s) for _, host_s in stamps(0.016)]
    after = [clock.observe(103.0) for _ in range(5)]
    assert after[0] == 103.0
    assert after[0] - before[-1] == pytest.approx(1.0, abs=0.03)
    assert [later > earlier for earlier, later in pairwise(after)] == [True] * 4


def test_a_slow_board_is_followed_from_its_third_line():
    """20 lines a second, each in a read of its own: 50 ms apart, and uneven reads are evened out."""
    clock, chance = CycleClock(), random.Random(3)
    told = [clock.observe(7.0 + 0.05 * number + chance.uniform(0, 0.01)) for number in range(60)]
    assert [b - a for a, b in pairwise(told[10:])] == pytest.approx([0.05] * 49, abs=0.004)


def test_a_pause_leaves_the_mean_cycle_as_it_was():
    """Ten lines 20 ms apart, a second of silence, and a line: the mean is still 20 ms."""
    clock = CycleClock()
    for number in range(10):
        clock.observe(5.0 + 0.02 * number)
    clock.observe(6.2)
    assert clock.cycle_s == pytest.approx(0.02)


def test_the_first_lines_are_as_far_apart_as_those_of_the_published_sketch():
    """4 ms before anything was measured, less a fiftieth of the 4 ms by which the second is ahead of its read."""
    clock = CycleClock()
    assert [clock.observe(10.0), clock.observe(10.0)] == pytest.approx([10.0, 10.00392], abs=1e-9)


def test_lines_are_never_closer_than_half_a_cycle():
    """A hundred of one read run ahead of it: the pull back ends at 2 ms of 4."""
    clock = CycleClock()
    told = [clock.observe(10.0) for _ in range(100)]
    assert min(after - before for before, after in pairwise(told)) == pytest.approx(0.002, abs=1e-9)


def test_lines_are_never_farther_apart_than_two_cycles_without_a_pause():
    """Ten lines each 1 ms are 0.1 ms apart; one that is 20 ms late would be pulled by 0.4 ms, and goes 0.2 ms on."""
    clock = CycleClock()
    told = [clock.observe(10.0 + 0.001 * read) for read in range(20) for _ in range(10)]
    assert clock.observe(told[-1] + 0.02) - told[-1] == pytest.approx(2 * clock.cycle_s, rel=1e-6)


@pytest.mark.parametrize(
    ("cycle_s", "late_s", "is_pause"),
    [(0.004, 0.022, False), (0.004, 0.027, True), (0.02, 0.09, False), (0.02, 0.12, True)],
)
def test_a_pause_is_both_25_ms_and_five_cycles(cycle_s: float, late_s: float, is_pause: bool):
    """At 4 ms a line that comes 22 ms late is pulled, at 20 ms one of 90 ms; 27 ms and 120 ms are pauses."""
    clock = CycleClock()
    for number in range(100):
        last_s = clock.observe(5.0 + cycle_s * number)
    host_s = last_s + cycle_s + late_s
    assert (clock.observe(host_s) == host_s) is is_pause


def test_the_mean_cycle_forgets_within_a_second():
    """200 lines 10 ms apart, then one after 0.2 s: each interval counts by ``exp(-age)``, the age in seconds."""
    clock = CycleClock()
    for number in range(200):
        clock.observe(5.0 + 0.01 * number)
    clock.observe(5.0 + 1.99 + 0.2)
    weights = math.fsum(math.exp(-0.2 - 0.01 * age) for age in range(199))
    assert clock.cycle_s == pytest.approx((0.01 * weights + 0.2) / (weights + 1), rel=1e-6)
