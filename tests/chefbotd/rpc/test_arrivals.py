"""How old a command may be, and which stops came after it."""

import asyncio
import math

import pytest

from chefbotd.clock import ManualClock, run_virtual
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from tests.fakes.api import new_server
from tests.fakes.robot import FakeRobot


def test_bytes_are_as_old_as_the_tick_before_the_last_one() -> None:
    """The sockets were polled between two ticks: 10.000 and 10.025, read at 10.030; after a freeze of 3 s as well."""
    clock = ManualClock(10.0)
    arrivals = Arrivals(clock)
    assert arrivals.earliest().stamp_s == 10.0
    arrivals.tick()
    clock.advance(0.025)
    arrivals.tick()
    clock.advance(0.005)
    assert arrivals.earliest().stamp_s == 10.0
    clock.advance(3.0)
    assert abs(arrivals.age_s(arrivals.earliest()) - 3.03) < 1e-9
    arrivals.tick()  # the timer may run before what has waited is read
    assert abs(arrivals.age_s(arrivals.earliest()) - 3.005) < 1e-9
    clock.advance(0.025)
    arrivals.tick()
    assert abs(arrivals.age_s(arrivals.earliest()) - 0.025) < 1e-9


@pytest.mark.parametrize(("command_timeout_s", "ticks"), [(0.5, 20), (0.4, 40)])
def test_two_ticks_are_little_of_the_time_that_a_command_holds(
    command_timeout_s: float, ticks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten beats of 50 ms: the socket ticks with them. Commands that hold for less: every 25 ms."""
    monkeypatch.setattr(FakeRobot, "command_timeout_s", command_timeout_s)

    async def scenario() -> int:
        server, _, _ = new_server()
        ticked, told = server.arrivals.tick, list[float]()
        monkeypatch.setattr(server.arrivals, "tick", lambda: (told.append(0.0), ticked()))
        running = asyncio.create_task(server.run())
        await asyncio.sleep(0.01)
        before = len(told)
        await asyncio.sleep(1.0)
        running.cancel()
        return len(told) - before

    assert run_virtual(scenario()) == ticks


def test_each_transport_marks_its_unread_bytes_before_a_stop() -> None:
    """Two transports are told the time, the stops until now (1, then none) and whose stop it is."""
    arrivals, marked = Arrivals(ManualClock(7.0)), list[tuple[str, ByteArrival, object]]()
    arrivals.record_stop(None, "Bob")
    arrivals.add_transport(lambda arrival, client: marked.append(("tcp", arrival, client)))
    arrivals.add_transport(lambda arrival, client: marked.append(("web", arrival, client)))
    arrivals.record_stop("her connection", "Ann")
    before = ByteArrival(7.0, 1)
    assert marked == [("tcp", before, "her connection"), ("web", before, "her connection")]
    assert (arrivals.stops, arrivals.stopped_by) == (2, "Ann")
    assert arrivals.is_before_a_stop(before)
    assert not arrivals.is_before_a_stop(arrivals.earliest())


def test_what_may_have_come_before_a_pause_ended_is_told() -> None:
    """Ticks at 8 and 8.0625, a pause until 8.4375: what is read before the second tick after it may be from before."""
    clock, resumed_s = ManualClock(8.0), -math.inf
    arrivals = Arrivals(clock, lambda: resumed_s)
    before = []
    for until_next_s in (0.0625, 0.375, 0.0625, 0.0625):
        arrivals.tick()
        clock.advance(until_next_s)
        resumed_s = clock.now_s() if until_next_s > 0.25 else resumed_s
        before.append(arrivals.is_before_a_pause_ended(arrivals.earliest()))
    assert before == [False, True, True, False]
