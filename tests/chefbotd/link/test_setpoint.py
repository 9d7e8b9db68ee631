"""The one waiting setpoint."""

import asyncio

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.link.send_window import SendWindow
from chefbotd.link.setpoint import SetpointWriter


class Wire:
    """The far end: remembers what was written and when, and can be busy."""

    def __init__(self) -> None:
        self.busy = False
        self.written: list[tuple[float, tuple[int, ...]]] = []
        self.start_s = LoopClock().now_s()
        self.window = SendWindow(100_000, 2, lambda duty: 10)
        self.writer = SetpointWriter(
            self._take, lambda: not self.busy, LoopClock().now_s, interval_s=0.005, window=self.window
        )

    def _take(self, duty: tuple[int, ...], now_s: float, first: bool) -> None:
        self.window.note(duty, now_s)
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


def test_behind_a_full_board_the_newest_waits_for_a_sign():
    """A board of 63 bytes that says nothing: four lines of ten, then the newest as soon as two cycles have come."""

    async def scenario() -> list[tuple[int, ...]]:
        wire = Wire()
        wire.window = wire.writer._window = SendWindow(63, 2, lambda duty: 10)
        for number in range(1, 31):
            wire.writer.offer((number, -number))
            await asyncio.sleep(0.01)
        first = [duty for _, duty in wire.written]
        assert wire.writer.ceiling(LoopClock().now_s()) == first[-1]
        for _ in range(3):
            wire.window.cycle(LoopClock().now_s())
            wire.writer.heard()
            await asyncio.sleep(0.02)
        assert wire.writer.ceiling(LoopClock().now_s()) is None
        return [duty for _, duty in wire.written]

    assert run_virtual(scenario()) == [(1, -1), (2, -2), (3, -3), (30, -30)]


def test_a_stop_of_one_wheel_that_turned_does_not_wait():
    """Of (0, 50), where one wheel stands already, the stop is written at once, also behind a busy wire."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        wire.writer.offer((0, 50))
        wire.busy = True
        await asyncio.sleep(0.001)
        wire.writer.offer((0, 0))
        return wire.written

    assert run_virtual(scenario()) == [(0.0, (0, 50)), (0.001, (0, 0))]


def test_two_bursts_keep_their_distance():
    """The timer of the first burst is spent with it: the second one's newest has to wait its own 5 ms."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        for start in (10, 20):
            for number in range(3):
                wire.writer.offer((start + number, -start))
            await asyncio.sleep(0.0202)
        return wire.written

    expected = [
        (0.0, (10, -10)),
        (0.0, (11, -10)),
        (0.005, (12, -10)),
        (0.0202, (20, -20)),
        (0.0202, (21, -20)),
        (0.0252, (22, -20)),
    ]
    assert run_virtual(scenario()) == expected


def test_what_drained_in_time_is_not_sent_again_by_its_timer():
    """A resume before the timer sends what waits; the timer is off then, and hurries nothing that comes after it."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        for number in (1, 2, 3):
            wire.writer.offer((number, -9))
        await asyncio.sleep(0.004)
        wire.writer.resume()
        wire.writer.offer((4, -9))
        await asyncio.sleep(0.1)
        return wire.written

    assert run_virtual(scenario())[2:] == [(0.004, (3, -9)), (0.01, (4, -9))]


def test_after_a_lost_link_no_timer_sends_the_next_links_command_early():
    """Forgotten with a timer under way: what is offered then to a busy wire waits for the wire, not for the timer."""

    async def scenario() -> list[tuple[float, tuple[int, ...]]]:
        wire = Wire()
        for number in (1, 2, 3):
            wire.writer.offer((number, -9))
        wire.writer.forget()
        wire.busy = True
        await asyncio.sleep(0.006)
        wire.writer.offer((4, -9))
        await asyncio.sleep(0.1)
        assert len(wire.written) == 2
        wire.busy = False
        wire.writer.heard()
        return wire.written

    assert run_virtual(scenario())[2:] == [(0.106, (4, -9))]


def test_behind_a_busy_wire_what_slows_goes_at_once_and_what_is_faster_waits():
    """Unsent bytes hold (60, -45), not (50, -30) nor (0, -30); and while the former waits, there is a ceiling."""

    async def scenario() -> list[tuple[int, ...]]:
        wire = Wire()
        wire.writer.offer((55, -40))
        assert wire.writer.ceiling(LoopClock().now_s()) is None
        wire.busy = True
        await asyncio.sleep(0.01)
        wire.writer.offer((60, -45))
        assert wire.writer.ceiling(LoopClock().now_s()) == (55, -40)
        await asyncio.sleep(0.01)
        wire.writer.offer((50, -30))
        await asyncio.sleep(0.01)
        wire.writer.offer((50, -30))
        await asyncio.sleep(0.01)
        wire.writer.offer((0, -30))
        return [duty for _, duty in wire.written]

    assert run_virtual(scenario()) == [(55, -40), (50, -30), (0, -30)]


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


def test_a_command_that_was_held_back_for_longer_than_its_time_is_dropped():
    """Offered to a busy wire, which is free again after 0.2 s in one run, after 0.4 s in the other: 0.3 s is the end."""

    async def scenario(free_after_s: float, duty: tuple[int, ...]) -> list[tuple[int, ...]]:
        wire = Wire()
        wire.writer.offer((10, 10))
        wire.busy = True
        wire.writer.offer(duty)
        await asyncio.sleep(free_after_s)
        wire.busy = False
        wire.writer.resume()
        return [written for _, written in wire.written]

    assert run_virtual(scenario(0.2, (50, 50))) == [(10, 10), (50, 50)]
    assert run_virtual(scenario(0.4, (50, 50))) == [(10, 10)]


def test_a_stale_command_that_slows_is_still_sent():
    """A silent board of 63 bytes has no room for (50, 50): 0.4 s later that still ends the faster one in force."""

    async def scenario() -> list[tuple[int, ...]]:
        wire = Wire()
        wire.window = wire.writer._window = SendWindow(63, 2, lambda duty: 10)
        for duty in ((90, 90), (95, 95), (100, 100), (70, 70), (50, 50)):
            wire.writer.offer(duty)
            await asyncio.sleep(0.01)
        assert wire.written[-1][1] == (70, 70)
        await asyncio.sleep(0.4)
        for _ in range(2):
            wire.window.cycle(LoopClock().now_s())
            wire.writer.heard()
            await asyncio.sleep(0.02)
        return [duty for _, duty in wire.written]

    assert run_virtual(scenario()) == [(90, 90), (95, 95), (100, 100), (70, 70), (50, 50)]
