"""The clock that several simulated robots share: nobody is left behind, and nobody who has gone is waited for."""

import asyncio
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from chefbotd.components.simulation.process.hardware import SharedClockLoop
from chefbotd.shared_clock import CATCHES_UP_S, START_S, TICK_S, ClockServer, SharedClock, next_due_s

FAST = "1e6"
"""The clock goes as fast as those that keep to it."""


Join = Callable[[], SharedClock]


@pytest.fixture
def join(tmp_path: Path) -> Iterator[Join]:
    """Keep to a clock, whose program runs meanwhile; as often as is called."""
    path = tmp_path / "clock"
    with ExitStack() as stack:
        program = subprocess.Popen([sys.executable, "-m", "chefbotd.shared_clock", str(path), FAST])
        stack.callback(program.wait)
        stack.callback(program.kill)
        ends_s = time.monotonic() + 100.0
        while not path.exists() and time.monotonic() < ends_s:
            time.sleep(0.02)

        def join() -> SharedClock:
            clock = SharedClock(path)
            stack.callback(lambda: clock.socket.close())  # it may have come back with another one
            return clock

        yield join


def test_it_stands_still_while_one_has_something_to_do(join: Join) -> None:
    """Two keep to it; one waits for the next tick, which comes when the other waits too."""
    one, other = join(), join()
    began_s = other.now_s()
    one.done()
    one.socket.settimeout(0.2)  # a clock that went on would have told in far less
    with pytest.raises(TimeoutError):
        one.receive()
    assert other.now_s() == began_s
    one.socket.settimeout(None)
    other.done()
    one.receive()
    other.receive()
    assert one.now_s() == other.now_s() == began_s + TICK_S


def test_who_goes_is_not_waited_for(join: Join) -> None:
    """The other one's connection ends while it has something to do."""
    one, other = join(), join()
    other.socket.close()
    one.sleep(1.0)
    assert one.now_s() >= START_S + 1.0


def test_nobody_waits_for_who_is_away(join: Join) -> None:
    """One second passes for the other meanwhile; back again, it has the present time, and is waited for as before."""
    one, other = join(), join()
    with other.away():
        one.sleep(1.0)
        assert other.now_s() < START_S + 1.0
    assert other.now_s() >= START_S + 1.0
    began_s = other.now_s()
    one.done()
    one.socket.settimeout(0.2)
    with pytest.raises(TimeoutError):
        one.receive()
    assert one.now_s() == began_s


def test_sleepers_wake_at_the_first_tick_that_is_late_enough(join: Join) -> None:
    """And not before; no sleep is shorter than a tick."""
    clock = join()
    began_s = clock.now_s()
    clock.sleep(0.012)
    assert clock.now_s() == pytest.approx(began_s + 3 * TICK_S)
    clock.sleep(0.0)
    assert clock.now_s() == pytest.approx(began_s + 4 * TICK_S)


def test_a_loop_on_it_sleeps_by_it_and_hears_sockets_meanwhile(join: Join) -> None:
    """An hour passes at once; a byte that another thread sends does not wait for the end of it."""
    loop = SharedClockLoop(join())
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    order: list[str] = []

    async def listen() -> None:
        assert await loop.sock_recv(ours, 1) == b"x"
        order.append("heard")

    async def sleep() -> None:
        began_s = loop.time()
        await asyncio.sleep(60.0)
        assert began_s + 60.0 <= loop.time() < began_s + 60.0 + 2 * TICK_S
        order.append("slept")

    async def both() -> None:
        listening = asyncio.create_task(listen())
        await asyncio.sleep(0.01)
        theirs.sendall(b"x")
        await sleep()
        await listening

    loop.run_until_complete(both())
    loop.close()
    ours.close()
    theirs.close()
    assert order == ["heard", "slept"]


def test_a_clock_that_has_ended_ends_who_keeps_to_it() -> None:
    """An error that says so; time does not stand still for ever."""
    ours, theirs = socket.socketpair()
    clock = SharedClock.__new__(SharedClock)
    clock.socket = ours
    theirs.close()
    with pytest.raises(ConnectionError, match="the shared clock has ended"):
        clock.receive()
    ours.close()


def test_what_a_stalled_computer_lost_is_not_made_up_for() -> None:
    """After a second without the processor the clock does not race through 200 ticks; a late tick or two it makes up."""
    assert next_due_s(10.0, 10.001, 0.005) == pytest.approx(10.005)
    assert next_due_s(10.0, 10.012, 0.005) == pytest.approx(10.005)
    assert next_due_s(10.0, 11.0, 0.005) == pytest.approx(11.0 - CATCHES_UP_S)


def test_a_pace_that_is_none_is_refused(tmp_path: Path) -> None:
    """A clock that stands still would be of no use."""
    with pytest.raises(ValueError, match="expected a pace above 0, got 0"):
        ClockServer(tmp_path / "clock", 0.0)
