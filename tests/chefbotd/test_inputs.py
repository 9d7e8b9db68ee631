"""InputLog from outside: one time for each, recorded in their order."""

import asyncio
from typing import Any

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import Clock, LoopClock, ManualClock, run_virtual
from chefbotd.core.events import EncodersCounted, SafetyChanged
from chefbotd.core.events.inputs import (
    ENTRIES,
    DaemonStarted,
    DaemonStopping,
    EventObserved,
    LinkBytesRead,
    LinkBytesWritten,
    RequestHandled,
    TaskStepped,
    TimerFired,
)
from chefbotd.features.feature import Feature
from chefbotd.inputs import InputLog, due_of, inputs_of
from chefbotd.snapshot import DaemonState
from chefbotd.testing.daemon import simulated_robot

SAID = SafetyChanged(7.0, "armed", "", None)


def recorded(entries: InputLog, bus: Bus) -> list[Any]:
    """What is published from now on."""
    taken: list[Any] = []
    for kind in (*ENTRIES, SafetyChanged):
        bus.add_handler(taken.append, kind)
    entries.begin_recording()
    return taken


def test_the_clock_stands_still_while_an_entry_is_handled() -> None:
    """What follows from an entry sees the time of its beginning, however long it takes."""
    clock = ManualClock(5.0)
    entries = InputLog(clock, Bus())
    with entries.entry(TimerFired, "tick"):
        clock.advance(0.25)
        assert entries.now_s() == 5.0
    assert entries.now_s() == 5.25


def test_an_entry_within_another_belongs_to_it() -> None:
    """It is told of once, and the time goes on after the outer one."""
    clock, bus = ManualClock(5.0), Bus()
    entries = InputLog(clock, bus)
    taken = recorded(entries, bus)
    with entries.entry(TimerFired, "outer"):
        clock.advance(1.0)
        with entries.entry(TimerFired, "inner"):
            assert entries.now_s() == 5.0
        assert entries.now_s() == 5.0
    assert taken == [TimerFired(5.0, "outer")]


def test_nothing_is_published_while_nobody_records() -> None:
    """Not before a recorder has begun, nor after the last one has ended."""
    bus = Bus()
    entries = InputLog(ManualClock(5.0), bus)
    inbox = bus.subscribe_all(10)
    end_first, end_second = entries.begin_recording(), entries.begin_recording()
    end_first()
    end_first()
    assert entries.recording
    end_second()
    with entries.entry(TimerFired, "tick"):
        pass
    assert not len(inbox)


def test_what_was_observed_outside_follows_its_record() -> None:
    """The record says that the event after it is no consequence of what the robot does."""
    bus = Bus()
    entries = InputLog(ManualClock(5.0), bus)
    taken = recorded(entries, bus)
    entries.observe(bus, SAID)
    assert taken == [EventObserved(5.0), SAID]


def test_a_clock_that_knows_no_entries_gets_them() -> None:
    """A part that is built on its own works as in the daemon."""
    entries = InputLog(ManualClock(5.0))
    assert inputs_of(entries) is entries
    assert inputs_of(ManualClock(6.0)).now_s() == 6.0


def test_each_step_of_a_task_is_an_entry() -> None:
    """Two waits are three steps, and the time of each is the one at which the task went on."""

    async def main() -> None:
        bus = Bus()
        entries = InputLog(LoopClock(), bus)
        taken, began_s = recorded(entries, bus), LoopClock().now_s()

        async def work() -> int:
            await asyncio.sleep(0.5)
            await asyncio.sleep(0.25)
            return 3

        assert await asyncio.create_task(entries.in_steps("work", work)) == 3
        assert [(each.stamp_s - began_s, each.cancelled) for each in taken] == [
            (0.0, False),
            (0.5, False),
            (0.75, False),
        ]
        assert {type(each) for each in taken} == {TaskStepped}

    run_virtual(main())


def test_a_service_is_at_rest_where_it_says_so_and_until_it_is_woken() -> None:
    """Not before its first wait, not in the middle of what it does, and not when what it waits for has come."""

    async def main() -> None:
        entries = InputLog(LoopClock())
        orders, done = asyncio.Event(), asyncio.Event()

        async def serve() -> None:
            while True:
                await entries.at_rest(orders.wait())
                orders.clear()
                await done.wait()

        task = asyncio.create_task(entries.in_steps("serve", serve))
        await asyncio.sleep(0.1)
        steps = entries.running["serve"]
        assert steps.is_at_rest
        orders.set()
        assert not steps.is_at_rest
        await asyncio.sleep(0.1)
        assert not steps.is_at_rest
        done.set()
        await asyncio.sleep(0.1)
        assert steps.is_at_rest
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert entries.running == {}
        assert entries.resting == set()

    run_virtual(main())


def test_a_request_whose_wait_is_over_cannot_begin_again_from_a_state() -> None:
    """Until then it can, and nothing is under way; a service that is at something is under way, too."""

    async def main() -> None:
        entries = InputLog(LoopClock())
        end = asyncio.get_running_loop().create_future()
        state = DaemonState(entries, {}, lambda: ["request 1"], ())

        async def wait() -> None:
            await end
            await asyncio.sleep(0.5)

        tasks = [asyncio.create_task(entries.in_steps("request 1", wait, what="localize"))]
        await asyncio.sleep(0.1)
        assert state.is_settled
        end.set_result(None)
        assert state.record().left_out == ("request 1 (localize) is under way",)
        await asyncio.gather(*tasks)
        assert state.is_settled
        tasks = [asyncio.create_task(entries.in_steps("serve", lambda: asyncio.sleep(0.5)))]
        await asyncio.sleep(0.1)
        assert state.record().left_out == ("the service serve is in the middle of something",)
        await asyncio.gather(*tasks)

    run_virtual(main())


def test_a_timer_says_when_it_is_due_and_is_set_again_for_then() -> None:
    """While it waits; one that was cancelled, or has fired, is due no more, and nothing is set again for it."""

    async def main() -> None:
        entries, fired = InputLog(LoopClock()), list[float]()
        began_s = entries.now_s()
        timer = entries.call_later(0.5, lambda: None, "a")
        due_s = due_of(timer)
        assert due_s == pytest.approx(began_s + 0.5)
        timer.cancel()
        assert due_of(timer) is due_of(None) is None
        again = entries.resume(due_s, lambda: fired.append(entries.now_s()), "a")
        assert due_of(again) == pytest.approx(due_s)
        await asyncio.sleep(0.7)
        assert fired == [pytest.approx(due_s)]
        assert due_of(again) is None
        assert entries.resume(None, lambda: None, "a") is None

    run_virtual(main())


def test_a_task_that_is_cancelled_hears_so_in_a_step() -> None:
    """The cancellation reaches the coroutine, and is recorded as such."""

    async def main() -> None:
        bus = Bus()
        entries = InputLog(LoopClock(), bus)
        taken = recorded(entries, bus)
        heard: list[str] = []

        async def work() -> None:
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                heard.append("cancelled")
                raise

        task = asyncio.create_task(entries.in_steps("work", work))
        await asyncio.sleep(0.1)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert heard == ["cancelled"]
        assert [each.cancelled for each in taken] == [False, True]

    run_virtual(main())


def test_a_drive_is_recorded_with_all_that_came_in_and_went_out() -> None:
    """Requests, bytes both ways and timers, with the stamps of the events that follow from them."""
    inboxes = []

    def recorder(bus: Bus, clock: Clock) -> Feature:
        inboxes.append(bus.subscribe_all(100_000))
        inputs_of(clock).begin_recording()
        return Feature("recorder")

    async def main() -> None:
        async with simulated_robot(features=[recorder]) as robot:
            await robot.client.set_client_name("pilot")
            await asyncio.sleep(1.0)
            await robot.client.drive(0.2, -0.3)
            await asyncio.sleep(0.7)

    run_virtual(main())
    taken = [inboxes[0].take_event() for _ in range(len(inboxes[0]))]
    assert isinstance(taken[0], DaemonStarted)
    drives = [each for each in taken if isinstance(each, RequestHandled) and each.method == "drive"]
    assert [each.params for each in drives] == [{"linear_m_s": 0.2, "angular_rad_s": -0.3}]
    assert drives[0].name == "pilot"
    written = [each for each in taken if isinstance(each, LinkBytesWritten)]
    driven_s = next(each.stamp_s for each in written if not each.data.startswith(b"s 0 0\r"))
    assert driven_s == drives[0].stamp_s
    read = {each.stamp_s for each in taken if isinstance(each, LinkBytesRead)}
    counted = [each for each in taken if isinstance(each, EncodersCounted)]
    assert len(counted) > 20
    assert {each.arrival_s for each in counted} <= read
    assert {each.timer for each in taken if isinstance(each, TimerFired)} >= {
        "drive watch",
        "leases",
        "board health",
    }
    assert [each for each in taken if isinstance(each, DaemonStopping)]
