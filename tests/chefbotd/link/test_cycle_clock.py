"""The times of encoder lines that share a read."""

import random
from itertools import pairwise

import pytest

from chefbotd.link.cycle_clock import CycleClock

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
