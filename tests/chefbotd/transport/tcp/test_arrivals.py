"""How old a command may be, and which stops came after it."""

import socket

from chefbotd.clock import ManualClock
from chefbotd.transport.tcp.arrivals import Arrival, Arrivals, unread_bytes


class Inlet:
    """A socket that is told of stops."""

    def __init__(self) -> None:
        self.told: list[Arrival] = []

    def came_before(self, arrival: Arrival) -> None:
        """Remember it."""
        self.told.append(arrival)


def test_bytes_are_as_old_as_the_beat_before_the_last_one() -> None:
    """The sockets were looked at between two beats: 10.000 and 10.025, read at 10.030; after a freeze of 3 s as well."""
    clock = ManualClock(10.0)
    arrivals = Arrivals(clock)
    assert arrivals.earliest().stamp_s == 10.0
    arrivals.beat()
    clock.advance(0.025)
    arrivals.beat()
    clock.advance(0.005)
    assert arrivals.earliest().stamp_s == 10.0
    clock.advance(3.0)
    assert abs(arrivals.age_s(arrivals.earliest()) - 3.03) < 1e-9
    arrivals.beat()  # the timer may run before what has waited is read
    assert abs(arrivals.age_s(arrivals.earliest()) - 3.005) < 1e-9
    clock.advance(0.025)
    arrivals.beat()
    assert abs(arrivals.age_s(arrivals.earliest()) - 0.025) < 1e-9


def test_a_stop_tells_whose_bytes_lie_unread_but_for_its_own_client() -> None:
    """Of three sockets with bytes in the kernel and one without, two hear of the stop of the third."""
    arrivals, inlets = Arrivals(ManualClock(7.0)), [Inlet() for _ in range(4)]
    pairs = [socket.socketpair() for _ in inlets]
    for inlet, (near, far) in zip(inlets, pairs, strict=True):
        arrivals.watch(near.fileno(), inlet)
        if inlet is not inlets[3]:
            far.send(b"12345")
    assert [unread_bytes(near.fileno()) for near, _ in pairs] == [5, 5, 5, 0]
    arrivals.stop_carried_out(inlets[1], "Ann")
    assert [inlet.told for inlet in inlets] == [[Arrival(7.0, 0)], [], [Arrival(7.0, 0)], []]
    assert (arrivals.stops, arrivals.stopped_by) == (1, "Ann")
    assert arrivals.is_before_a_stop(Arrival(7.0, 0))
    assert not arrivals.is_before_a_stop(arrivals.earliest())
    for inlet, (near, far) in zip(inlets, pairs, strict=True):
        arrivals.unwatch(near.fileno(), inlet)
        near.close()
        far.close()
    arrivals.stop_carried_out(None, "Bob")
    assert [len(inlet.told) for inlet in inlets] == [1, 0, 1, 0]


def test_a_closed_socket_holds_nothing_and_hears_of_nothing() -> None:
    """Its descriptor is -1, or is not open any more."""
    arrivals, inlet = Arrivals(ManualClock()), Inlet()
    near, far = socket.socketpair()
    number = near.fileno()
    near.close()
    far.close()
    arrivals.watch(near.fileno(), inlet)
    arrivals.stop_carried_out(None, "Ann")
    assert (inlet.told, unread_bytes(near.fileno()), unread_bytes(number)) == ([], 0, 0)
