"""How old a command may be, and which stops came after it."""

from chefbotd.clock import ManualClock
from chefbotd.rpc.arrivals import Arrival, Arrivals


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


def test_ticks_are_seldom_while_nobody_sends() -> None:
    """Every 50 ms; every 25 ms for a second after a read, and after a loop that stood still for more than 0.2 s."""
    clock = ManualClock(10.0)
    arrivals = Arrivals(clock)

    def periods(count: int) -> list[float]:
        told = []
        for _ in range(count):
            clock.advance(0.11)
            told.append(arrivals.tick())
        return told

    assert periods(2) == [0.05, 0.05]
    arrivals.earliest()
    assert periods(13) == [0.025] * 10 + [0.05] * 3
    clock.advance(0.2)
    assert periods(13) == [0.025] * 10 + [0.05] * 3


def test_each_transport_marks_its_unread_bytes_before_a_stop() -> None:
    """Two transports are told the time, the stops until now (1, then none) and whose stop it is."""
    arrivals, marked = Arrivals(ManualClock(7.0)), list[tuple[str, Arrival, object]]()
    arrivals.record_stop(None, "Bob")
    arrivals.add_transport(lambda arrival, client: marked.append(("tcp", arrival, client)))
    arrivals.add_transport(lambda arrival, client: marked.append(("web", arrival, client)))
    arrivals.record_stop("her connection", "Ann")
    before = Arrival(7.0, 1)
    assert marked == [("tcp", before, "her connection"), ("web", before, "her connection")]
    assert (arrivals.stops, arrivals.stopped_by) == (2, "Ann")
    assert arrivals.is_before_a_stop(before)
    assert not arrivals.is_before_a_stop(arrivals.earliest())
