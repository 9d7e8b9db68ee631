"""When a line was measured, by the board's clock and by the host's."""

import asyncio
from itertools import pairwise

import pytest

from chefbotd.clock import LoopClock
from chefbotd.core import events
from firmware_protocol import messages as wire
from tests.chefbotd.link.bench import Bench, cycle, on_bench


def test_what_waited_on_the_way_is_stamped_with_when_it_was_measured():
    """Sixty cycles are read as they come; three then wait until they are read at once, 53 ms after the first of them."""

    async def scenario(bench: Bench) -> None:
        start_s = LoopClock().now_s()
        for number in range(60):
            bench.session.data_received(cycle(number))
            await asyncio.sleep(0.02)
        bench.heard()
        await asyncio.sleep(0.053)
        bench.session.data_received(cycle(60) + cycle(61) + cycle(62))
        events_ = bench.heard()
        counted = [event for event in events_ if isinstance(event, events.EncodersCounted)]
        echoed = [event for event in events_ if isinstance(event, events.UltrasonicEchoed)]
        assert [each.stamp_s - start_s for each in counted] == pytest.approx([1.20, 1.22, 1.24])
        assert [each.stamp_s - start_s for each in echoed] == pytest.approx([1.20, 1.22, 1.24])
        assert [each.arrival_s - start_s for each in events_] == pytest.approx([1.253] * 6)

    on_bench(scenario)


def test_a_cycle_whose_time_was_damaged_is_stamped_as_late_as_the_one_before():
    """Its counts come 21 ms after a `t` that was on time."""

    async def scenario(bench: Bench) -> None:
        for number in range(60):
            bench.session.data_received(cycle(number))
            await asyncio.sleep(0.02)
        bench.heard()
        await asyncio.sleep(0.001)
        bench.session.data_received(b"t\t62x0000\t0.02\ne\t181\t-121\n")
        _, counted = bench.heard()
        assert counted.stamp_s == pytest.approx(counted.arrival_s)

    on_bench(scenario)


def test_a_board_without_a_clock_has_its_lines_stamped_by_even_cycles():
    """Four `e` lines a read, 16 ms apart: none is stamped after the read, the first a cycle or more before it."""

    async def scenario(bench: Bench) -> None:
        for number in range(0, 400, 4):
            await asyncio.sleep(0.016)
            lines = b"".join(b"e\t%d\t%d\n" % (k, -k) for k in range(number, number + 4))
            bench.session.data_received(lines + b"u\t41\n")
        *_, first, second, third, last, echoed = bench.heard()
        assert second.stamp_s - first.stamp_s == pytest.approx(0.004, abs=1e-4)
        assert first.stamp_s <= first.arrival_s - 0.004
        assert second.stamp_s <= third.stamp_s <= last.stamp_s <= last.arrival_s
        assert echoed.stamp_s == echoed.arrival_s == last.arrival_s

    on_bench(scenario)


def test_encoders_without_a_time_line_are_timed_by_the_host():
    """The second cycle's `t` was lost: its counts are placed by how long the host waited."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0)
        await asyncio.sleep(0.021)
        bench.board.say(wire.EncoderCounts((10, 10)))
        first, second = bench.heard()
        assert second.board_s - first.board_s == pytest.approx(0.021)

    on_bench(scenario)


def test_counts_of_a_doubtful_cycle_wait_for_the_next():
    """A `t` line that lost digits: its cycle's counts are not passed on; the next cycle's are, and nothing is lost."""

    async def scenario(bench: Bench) -> None:
        bench.board.cycle(0, 0)
        await asyncio.sleep(0.02)
        bench.board.say(b"t\t4000000004\t0.02\n", wire.EncoderCounts((10, 10)))
        await asyncio.sleep(0.02)
        bench.board.say(wire.BoardTime(60_000, 0.02), wire.EncoderCounts((20, 20)))
        assert [event.counts for event in bench.heard()] == [(0, 0), (20, 20)]

    on_bench(scenario)


def times_of_lines(chunk: int) -> list[float]:
    """Five ``e`` lines every 17 ms from a board without ``t``, in chunks of so many bytes: when each was printed."""
    found: list[float] = []

    async def scenario(bench: Bench) -> None:
        start_s, number = LoopClock().now_s(), 0
        for _ in range(90):
            data = b""
            for _ in range(5):
                number += 1
                data += b"e\t%d\t%d\ns\t0.00\t0.00\n" % (10 * number, 9 * number)
            for start in range(0, len(data), chunk):
                bench.device.feed(data[start : start + chunk])
            await asyncio.sleep(0.017)
            counted = [event for event in bench.heard() if isinstance(event, events.EncodersCounted)]
            found.extend(event.board_s - start_s for event in counted)

    on_bench(scenario)
    return found


def test_lines_of_one_read_are_spread_whatever_their_chunks():
    """From the first second on they are 3.4 ms apart, and byte by byte the very same times come out."""
    whole = times_of_lines(10_000)
    steps = [after - before for before, after in pairwise(whole[300:])]
    assert len(whole) == 450
    assert steps == pytest.approx([0.0034] * len(steps), rel=0.15)
    assert times_of_lines(1) == pytest.approx(whole, abs=1e-9)
    assert times_of_lines(7) == pytest.approx(whole, abs=1e-9)


def test_counts_that_come_in_a_read_of_their_own_have_their_cycles_time():
    """The ``e`` line is read 5 ms after its ``t``: by the board they are of the same moment."""

    async def scenario(bench: Bench) -> None:
        for number in range(3):
            start_s = LoopClock().now_s()
            bench.session.data_received(b"t\t%d\t0.02\n" % (5_000_000 + number * 20_000))
            await asyncio.sleep(0.005)
            bench.session.data_received(b"e\t%d\t%d\n" % (number * 3, number * -2))
            await asyncio.sleep(0.015)
        *_, counted = bench.heard()
        assert counted.stamp_s == pytest.approx(start_s)
        assert counted.board_s == pytest.approx(start_s)
        assert counted.arrival_s == pytest.approx(start_s + 0.005)

    on_bench(scenario)
