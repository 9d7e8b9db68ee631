"""How old a client's bytes can be."""

from chefbotd.clock import ManualClock
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.transport.unread import HeldBytes

LINE = b'{"method":"ping"}\n'


def held_at(clock: ManualClock, unread_since: ByteArrival | None = None) -> tuple[HeldBytes, Arrivals]:
    """Nothing was held before; there was no tick, so that what is read has come just now."""
    arrivals = Arrivals(clock)
    return HeldBytes(arrivals, unread_since), arrivals


def test_a_request_is_as_old_as_its_first_byte() -> None:
    """Begun at 3 s, ended at 4.5 s with the next one begun: the first counts from 3 s, the next from 4.5 s."""
    clock = ManualClock(3.0)
    held, _ = held_at(clock)
    assert held.arrival_of(b"", partial=True).stamp_s == 3.0
    clock.advance(1.5)
    assert held.arrival_of(LINE, partial=True).stamp_s == 3.0
    clock.advance(0.25)
    assert held.arrival_of(LINE, partial=False).stamp_s == 4.5


def test_what_is_held_behind_its_own_stop_is_newer_than_that_one_alone() -> None:
    """Stop 1 was the client's: what had arrived before it counts as sent after it; another's stop 2 stays after that."""
    held, _ = held_at(ManualClock(1.0), ByteArrival(0.5, stops=0))
    held.record_own_stop(0, 1)
    assert held.unread_since == ByteArrival(0.5, stops=1)
    held.record_own_stop(2, 3)
    assert held.unread_since == ByteArrival(0.5, stops=1)
