"""Clocks and the virtual loop."""

import asyncio
import time
from typing import Any, cast

import pytest

from chefbotd.clock import (
    Deadlock,
    LoopClock,
    ManualClock,
    SystemClock,
    VirtualLoop,
    next_beat,
    run_virtual,
)


def test_the_system_clock_goes_on_while_the_computer_sleeps():
    """A reading lies between two readings of CLOCK_BOOTTIME around it; that counts suspended time (clock_gettime(2))."""
    before = time.clock_gettime(time.CLOCK_BOOTTIME)
    now = SystemClock().now_s()
    assert before <= now <= time.clock_gettime(time.CLOCK_BOOTTIME)


def test_a_manual_clock_moves_only_when_told():
    """It stands at its start, goes forward by what it is told, and refuses to go back."""
    clock = ManualClock(5.0)
    clock.advance(2.5)
    assert clock.now_s() == 7.5
    with pytest.raises(ValueError, match=r"got -1"):
        clock.advance(-1)


def test_an_hour_of_virtual_time_is_exact():
    """Sleeping 3600 times for a second adds up to 3600 s, and the loop clock says so."""

    async def scenario() -> float:
        clock = LoopClock()
        start = clock.now_s()
        for _ in range(3600):
            await asyncio.sleep(1.0)
        return clock.now_s() - start

    assert run_virtual(scenario()) == pytest.approx(3600.0, abs=1e-6)


def test_virtual_timers_fire_in_order():
    """Of two sleepers the shorter one wakes first, whatever order they were started in."""

    async def scenario() -> list[str]:
        woken: list[str] = []

        async def sleeper(name: str, seconds: float) -> None:
            await asyncio.sleep(seconds)
            woken.append(name)

        await asyncio.gather(sleeper("late", 20.0), sleeper("early", 10.0))
        return woken

    assert run_virtual(scenario()) == ["early", "late"]


def test_loopback_sockets_work_on_the_virtual_loop_without_time_passing():
    """A hundred echoes over TCP inside one process take no virtual time."""

    async def scenario() -> float:
        async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                writer.write(line)
            writer.close()

        server = await asyncio.start_server(echo, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname()[:2])
        start = LoopClock().now_s()
        for number in range(100):
            writer.write(b"%d\n" % number)
            assert await reader.readline() == b"%d\n" % number
        elapsed = LoopClock().now_s() - start
        writer.close()
        await reader.read()
        server.close()
        return elapsed

    assert run_virtual(scenario()) == 0.0


def test_a_scenario_that_can_never_end_is_an_error():
    """Waiting with no timer set raises instead of hanging."""

    async def scenario() -> None:
        await asyncio.get_running_loop().create_future()

    with pytest.raises(Deadlock, match="nothing can ever happen"):
        run_virtual(scenario())


def test_what_would_run_in_a_thread_runs_at_once() -> None:
    """A file that is read by ``asyncio.to_thread`` takes no virtual time, and its error reaches whoever waits."""

    async def play() -> None:
        begun_s = asyncio.get_running_loop().time()
        assert await asyncio.to_thread(divmod, 17, 5) == (3, 2)
        with pytest.raises(ZeroDivisionError):
            await asyncio.to_thread(divmod, 17, 0)
        assert asyncio.get_running_loop().time() == begun_s

    run_virtual(play())


def test_a_loop_that_stands_still_is_late_for_every_timer():
    """Two timers of 0.1 and 0.3 s, frozen for a second: both run at once after it."""

    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        began_s, ran_s = loop.time(), list[float]()
        for wait_s in (0.1, 0.3):
            loop.call_later(wait_s, lambda: ran_s.append(loop.time() - began_s))
        loop.stand_still(1.0)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        with pytest.raises(ValueError, match="-1"):
            loop.stand_still(-1)
        return ran_s

    assert run_virtual(main()) == [1.0, 1.0]


def test_what_waits_for_the_same_beat_is_woken_by_one_timer():
    """Asked at 0.007 s and 0.029 s: both wake at 0.05 s and know how long that took; of each second beat 0.2 s comes."""

    async def scenario() -> tuple[list[tuple[float, float]], int]:
        clock, woken = LoopClock(), list[tuple[float, float]]()
        loop, began_s = asyncio.get_running_loop(), clock.now_s()

        async def waiter(asked_s: float, beats: int) -> None:
            await asyncio.sleep(asked_s)
            waited_s = await next_beat(clock, beats)
            woken.append((clock.now_s() - began_s, waited_s))

        tasks = [asyncio.create_task(waiter(*each)) for each in ((0.007, 1), (0.029, 1), (0.129, 2))]
        await asyncio.sleep(0.03)
        timers = sum(not timer.cancelled() for timer in cast(Any, loop)._scheduled)
        tasks.append(asyncio.create_task(waiter(0.0, 1)))
        tasks[1].cancel()  # the others are woken all the same
        await asyncio.gather(*tasks, return_exceptions=True)
        return woken, timers

    woken, timers = run_virtual(scenario())
    assert [at_s for at_s, _ in woken] == pytest.approx([0.05, 0.05, 0.2], abs=1e-6)
    assert [waited_s for _, waited_s in woken] == pytest.approx([0.043, 0.02, 0.071], abs=1e-6)
    assert timers == 2  # this beat's, and that of the one who still sleeps


def test_who_is_woken_a_moment_early_does_not_wait_for_the_same_beat():
    """A clock at 7.4995 s, as a timer of whole milliseconds may fire: the next beat is that of 7.55 s."""

    async def scenario() -> float:
        return await next_beat(ManualClock(7.4995))

    assert run_virtual(scenario()) == pytest.approx(0.0505)
