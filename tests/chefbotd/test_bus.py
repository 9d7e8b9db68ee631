"""The event bus."""

import asyncio
from dataclasses import dataclass

import pytest

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.clock import run_virtual


@dataclass(frozen=True)
class Ticked:
    """An event."""

    number: int


@dataclass(frozen=True)
class Tocked:
    """Another."""

    number: int


def test_an_event_reaches_every_inbox_of_its_class_and_no_other():
    """Subscribing is by exact class; each subscriber has its own copy of the queue."""
    bus = Bus()
    ticks, more_ticks, tocks = bus.subscribe(Ticked), bus.subscribe(Ticked), bus.subscribe(Tocked)
    bus.publish(Ticked(1))
    assert (ticks.take_event(), more_ticks.take_event(), len(tocks)) == (Ticked(1), Ticked(1), 0)


def test_an_inbox_of_several_classes_keeps_their_order():
    """Events of different classes come out in the order in which they were published."""
    bus = Bus()
    inbox = bus.subscribe(Ticked, Tocked)
    for event in (Ticked(1), Tocked(2), Ticked(3)):
        bus.publish(event)
    assert [inbox.take_event() for _ in range(3)] == [Ticked(1), Tocked(2), Ticked(3)]


def test_a_full_inbox_drops_the_oldest_and_counts_it():
    """Room for two and three published: the first is gone, and the count says so, by class."""
    bus = Bus()
    inbox = bus.subscribe(Ticked, size=2)
    for number in (1, 2, 3):
        bus.publish(Ticked(number))
    assert [inbox.take_event(), inbox.take_event()] == [Ticked(2), Ticked(3)]
    assert inbox.dropped == {Ticked: 1}
    assert bus.drops() == {"Ticked": 1}


def test_a_kept_class_is_never_pushed_out_by_another():
    """A kept event among a flood of others waits on in its place; what gives way is the oldest of the others."""
    bus = Bus()
    inbox = bus.subscribe(Ticked, Tocked, size=3, kept=(Tocked,))
    for event in (Tocked(0), Ticked(1), Tocked(2), *map(Ticked, range(3, 100))):
        bus.publish(event)
    assert [inbox.take_event() for _ in range(len(inbox))] == [Tocked(0), Tocked(2), Ticked(99)]
    assert inbox.dropped == {Ticked: 97}


def test_an_inbox_full_of_kept_events_stays_bounded():
    """Nothing else is left to give way: another class finds no room, and of the kept class the oldest goes."""
    bus = Bus()
    inbox = bus.subscribe(Ticked, Tocked, size=2, kept=(Tocked,))
    for event in (Tocked(1), Tocked(2), Ticked(3), Tocked(4)):
        bus.publish(event)
    assert [inbox.take_event() for _ in range(len(inbox))] == [Tocked(2), Tocked(4)]
    assert inbox.dropped == {Ticked: 1, Tocked: 1}


def test_closing_an_inbox_ends_its_subscription_but_not_its_contents():
    """After close nothing more comes in; what had come can still be taken; closing twice is harmless."""
    bus = Bus()
    inbox = bus.subscribe(Ticked)
    bus.publish(Ticked(1))
    inbox.close()
    inbox.close()
    bus.publish(Ticked(2))
    assert inbox.take_event() == Ticked(1)
    assert len(inbox) == 0
    assert not bus.has_listeners(Ticked)


def test_wanted_tells_whether_anyone_listens():
    """A publisher can skip making an event for which there is no inbox."""
    bus = Bus()
    assert not bus.has_listeners(Ticked)
    bus.subscribe(Ticked)
    assert bus.has_listeners(Ticked)
    assert not bus.has_listeners(Tocked)


def test_get_waits_for_the_next_event():
    """A waiting subscriber is woken by the publication, and iterating goes on with the next."""

    async def scenario() -> list[Ticked]:
        bus = Bus()
        inbox = bus.subscribe(Ticked)
        asyncio.get_running_loop().call_later(1.0, bus.publish, Ticked(1))
        asyncio.get_running_loop().call_later(2.0, bus.publish, Ticked(2))
        taken = [await inbox.get()]
        async for event in inbox:
            taken.append(event)
            break
        return taken

    assert run_virtual(scenario()) == [Ticked(1), Ticked(2)]


def test_a_cancelled_subscriber_loses_nothing():
    """Cancelling a wait leaves the inbox usable and complete."""

    async def scenario() -> Ticked:
        bus = Bus()
        inbox = bus.subscribe(Ticked)
        waiting = asyncio.create_task(inbox.get())
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)
        bus.publish(Ticked(1))
        return await inbox.get()

    assert run_virtual(scenario()) == Ticked(1)


def test_senseless_subscriptions_are_refused():
    """An inbox without a class or without room is an error that says so."""
    with pytest.raises(ValueError, match="at least one event class"):
        Bus().subscribe()
    with pytest.raises(ValueError, match="got size 0"):
        Bus().subscribe(Ticked, size=0)
    with pytest.raises(ValueError, match="kept classes that are not subscribed to: Tocked"):
        Bus().subscribe(Ticked, kept=(Tocked,))


def test_a_handler_is_called_before_publish_returns():
    """With the events of its classes only, until it is removed; removing it twice is harmless."""
    bus, heard = Bus(), []
    remove = bus.add_handler(heard.append, Ticked)
    bus.publish(Ticked(1))
    bus.publish(Tocked(2))
    assert heard == [Ticked(1)]
    remove()
    remove()
    bus.publish(Ticked(3))
    assert heard == [Ticked(1)]
    assert not bus.has_listeners(Ticked)


def test_a_handler_that_raises_harms_nobody():
    """The publisher, the inboxes and the other handlers go on; the failure is counted by the event's class."""
    bus, heard = Bus(), []

    def fail(event: Ticked) -> None:
        raise RuntimeError(f"cannot take {event}")

    bus.add_handler(fail, Ticked)
    bus.add_handler(heard.append, Ticked)
    inbox = bus.subscribe(Ticked)
    bus.publish(Ticked(1))
    bus.publish(Ticked(2))
    assert heard == [Ticked(1), Ticked(2)]
    assert (inbox.take_event(), inbox.take_event()) == (Ticked(1), Ticked(2))
    assert bus.handler_errors == {"Ticked": 2}


def test_handlers_get_events_in_the_order_of_their_publication():
    """The first handler answers a tick with a tock: the second still hears the tick before the tock."""
    bus, heard = Bus(), []

    def answer(event: Ticked) -> None:
        bus.publish(Tocked(event.number * 10))

    bus.add_handler(answer, Ticked)
    bus.add_handler(heard.append, Ticked, Tocked)
    bus.publish(Ticked(1))
    bus.publish(Ticked(2))
    assert heard == [Ticked(1), Tocked(10), Ticked(2), Tocked(20)]


def test_a_subscriber_of_all_events_gets_every_class():
    """Also of classes that somebody else subscribes to, before or after it, and of those that nobody does."""
    bus = Bus()
    before = bus.subscribe(Ticked)
    everything = bus.subscribe_all(size=8)
    after = bus.subscribe(Tocked)
    assert bus.has_listeners(str)
    for event in (Ticked(1), Tocked(2), "text"):
        bus.publish(event)
    assert [everything.take_event() for _ in range(3)] == [Ticked(1), Tocked(2), "text"]
    assert (before.take_event(), after.take_event()) == (Ticked(1), Tocked(2))
    assert (len(before), len(after)) == (0, 0)


def test_a_subscriber_of_all_events_is_bounded_and_leaves():
    """What gave way is counted by class, once; after its end nothing is put into it and nobody is wanted."""
    bus = Bus()
    bus.subscribe(Ticked).close()
    everything = bus.subscribe_all(size=2)
    for number in range(5):
        bus.publish(Ticked(number))
    bus.publish(Tocked(9))
    assert bus.drops() == {"Ticked": 4}
    everything.close()
    bus.publish(Ticked(7))
    assert [everything.take_event(), everything.take_event()] == [Ticked(4), Tocked(9)]
    assert not bus.has_listeners(Ticked)
    assert not bus.has_listeners(str)
    with pytest.raises(ValueError, match="at least one event class"):
        bus.add_handler(print)


def test_a_handlers_error_goes_to_whoever_answers_for_it():
    """It is counted, the handlers after it are called all the same, and what ``on_error`` raises harms nobody."""
    bus, errors, heard = Bus(), [], []

    def fail(event: Ticked) -> None:
        raise ValueError(f"no {event.number}")

    def report(error: Exception) -> None:
        errors.append(str(error))
        raise RuntimeError("and no report either")

    bus.add_handler(fail, Ticked, on_error=report)
    bus.add_handler(heard.append, Ticked)
    bus.publish(Ticked(7))
    assert (errors, heard, bus.handler_errors) == (["no 7"], [Ticked(7)], {"Ticked": 1})


def test_what_is_held_is_delivered_in_its_order_with_what_follows_from_it():
    """Two pings are held: no handler hears them before ``deliver``, and their echoes come after both."""
    bus, heard = Bus(), []
    bus.add_handler(lambda ping: bus.publish(Tocked(ping.number)), Ticked)
    bus.add_handler(heard.append, Ticked)
    bus.add_handler(heard.append, Tocked)
    bus.hold()
    bus.publish(Ticked(1))
    bus.publish(Ticked(2))
    assert heard == []
    bus.deliver()
    assert heard == [Ticked(1), Ticked(2), Tocked(1), Tocked(2)]
    bus.publish(Ticked(3))
    assert heard[4:] == [Ticked(3), Tocked(3)]


def test_a_failure_is_raised_to_who_waits_also_if_it_came_before():
    """The first of two that came before is raised; the next wait ends with one that comes meanwhile."""

    async def scenario() -> list[str]:
        failure, raised = HandlerFailure(), []
        failure.report(ValueError("first"))
        failure.report(ValueError("second"))
        for _ in range(2):
            asyncio.get_running_loop().call_later(1.0, failure.report, ValueError("third"))
            try:
                await failure.wait()
            except ValueError as error:
                raised.append(str(error))
        return raised

    assert run_virtual(scenario()) == ["first", "third"]
