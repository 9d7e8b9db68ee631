"""The one waiting setpoint."""

import asyncio

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.link.setpoint import SetpointWriter


class Wire:
    """The far end: remembers what was written and when, and can be busy."""

    def __init__(self) -> None:
        self.busy = False
        self.written: list[tuple[float, tuple[int, ...]]] = []
        self.start_s = LoopClock().now_s()
        self.writer = SetpointWriter(self._take, lambda: not self.busy, LoopClock().now_s, interval_s=0.005)

    def _take(self, duty: tuple[int, ...]) -> None:
        self.written.append((round(LoopClock().now_s() - self.start_s, 6), duty))


def test_the_first_setpoint_goes_out_at_once():
    """Nothing was written before, so nothing has to wait."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        wire.writer.offer((10, 10))
        return wire.written

    assert run_virtual(scenario()) == [(0.0, (10, 10))]


def test_setpoints_keep_their_distance_and_the_newest_wins():
    """Ten in 4 ms at 5 ms each: two close together, then the last when the first has had its 5 ms."""

    async def scenario() -> tuple[list[tuple[float, tuple[int, ...]]], int]:
        wire = Wire()
        for number in range(1, 11):
            wire.writer.offer((number, number))
            await asyncio.sleep(0.0004)
        await asyncio.sleep(0.1)
        return wire.written, wire.writer.replaced

    assert run_virtual(scenario()) == ([(0.0, (1, 1)), (0.0004, (2, 2)), (0.005, (10, 10))], 7)


def test_a_stop_does_not_wait():
    """Zero after motion is written at once, also within the interval; repeating it keeps the distance."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        wire.writer.offer((10, 10))
        await asyncio.sleep(0.001)
        wire.writer.offer((0, 0))
        wire.writer.offer((0, 0))
        await asyncio.sleep(0.1)
        return wire.written

    assert run_virtual(scenario()) == [(0.0, (10, 10)), (0.001, (0, 0)), (0.005, (0, 0))]


def test_behind_a_slow_reader_only_the_newest_waits():
    """While the wire is busy nothing queues; when it has drained the newest setpoint goes, and only that."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        wire.busy = True
        for number in range(1, 4):
            wire.writer.offer((number, number))
            await asyncio.sleep(0.01)
        assert wire.written == []
        wire.busy = False
        wire.writer.resume()
        wire.writer.resume()
        return wire.written

    assert run_virtual(scenario()) == [(0.03, (3, 3))]


def test_a_lost_link_forgets_what_waited():
    """After forget nothing is written by the timer, and the next setpoint is a first one again."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        wire.writer.offer((1, 1))
        wire.writer.offer((2, 2))
        wire.writer.offer((3, 3))
        wire.writer.forget()
        await asyncio.sleep(0.1)
        return wire.written

    assert run_virtual(scenario()) == [(0.0, (1, 1)), (0.0, (2, 2))]


def test_a_second_of_setpoints_is_two_hundred_lines():
    """A setpoint every millisecond for a second, 5 ms apiece: 200 lines, and the one that was ahead."""

    async def scenario() -> int:
        wire = Wire()
        for number in range(1, 1001):
            wire.writer.offer((number, number))
            await asyncio.sleep(0.001)
            wire.writer.heard()
        return sum(at_s < 0.999 for at_s, _ in wire.written)

    assert run_virtual(scenario()) == 201


def test_behind_a_full_kernel_the_newest_waits_for_a_sign():
    """The kernel takes everything and the board says nothing: ten lines, then the newest as soon as the board speaks."""

    async def scenario() -> list[tuple[int, ...]]:
        wire = Wire()
        for number in range(1, 31):
            wire.writer.offer((number, number))
            await asyncio.sleep(0.01)
        assert len(wire.written) == 10
        wire.writer.heard()
        return [duty for _, duty in wire.written[9:]]

    assert run_virtual(scenario()) == [(10, 10), (30, 30)]


def test_a_sign_does_not_hurry_what_waits_for_its_turn():
    """A line from the board within the 5 ms changes nothing: the third setpoint goes at 5 ms."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        for number in range(1, 4):
            wire.writer.offer((number, number))
        wire.writer.heard()
        await asyncio.sleep(0.1)
        return wire.written

    assert run_virtual(scenario())[2] == (0.005, (3, 3))
