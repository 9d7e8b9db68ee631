"""Recorded agents, replayed: what they said, their buttons, questions and calls are the same, bit for bit."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

from chefbotd.client import CallError, Client
from chefbotd.components.agents.events import AgentsChanged
from chefbotd.core.events.inputs import StateRecorded
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import (
    LateRecorder,
    recorded,
    recorded_late,
    replayed,
)

AGENTS = {"AgentsChanged", "AgentSaid", "AgentNotified", "AgentPublished"}


async def meets(robot: SimulatedRobot, meanwhile: Callable[[], Awaitable[None]]) -> None:
    """A waiter and a guest; ``meanwhile`` is awaited while two questions and a call wait for their answers."""
    where, guest = await robot.daemon.server.address(), robot.client
    async with Client.connect(*where, name="the waiter") as waiter:
        await waiter.register_agent("waiter", "1.0", ["bring"])
        button_id = (await waiter.add_button("Table 1")).button_id
        first = asyncio.create_task(waiter.ask("Taken?", ["yes", "no"], 30.0))
        second = asyncio.create_task(waiter.ask("Again?", ["yes"], 7.3))
        await asyncio.sleep(0.37)
        call = asyncio.create_task(guest.call_agent("waiter", "bring", {"dish": "soup"}, 9.1))
        await asyncio.sleep(2.9)
        await meanwhile()
        await guest.press_button(button_id)
        await waiter.say("I go to table 1")
        await guest.answer_agent((await guest.get_state()).agents.questions[0].question_id, "no")
        assert (await first).choice == "no"
        assert (await second).choice is None
        await waiter.publish_to_topic("orders", {"open": [1]})
        given_up = asyncio.create_task(waiter.ask("Given up?", ["yes"]))
        await asyncio.sleep(0.21)
        given_up.cancel()
        await asyncio.sleep(0.23)
        with contextlib.suppress(CallError):
            await call
        last = asyncio.create_task(guest.call_agent("waiter", "bring", {}, 20.0))
        await asyncio.sleep(0.3)
    with contextlib.suppress(CallError):
        await last
    await asyncio.sleep(0.5)


def test_agents_are_replayed_bit_for_bit() -> None:
    """Answered, not answered in time, given up, and an agent that leaves while it is called."""

    async def nothing() -> None:
        await asyncio.sleep(0.1)

    settings = load()
    outcome = replayed(recorded(lambda robot: meets(robot, nothing), settings), settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.exact
    assert set(outcome.comparison.rows) >= AGENTS


def test_a_recording_that_begins_while_a_question_waits_is_replayed_bit_for_bit() -> None:
    """Two questions and a call wait then: nothing is left out, and each ends as it did."""

    async def script(robot: SimulatedRobot, recorder: LateRecorder) -> None:
        async def begin() -> None:
            recorder.begin()

        await asyncio.sleep(1.2)
        await meets(robot, begin)

    settings = load()
    events = recorded_late(script, settings)
    assert isinstance(events[0], StateRecorded)
    assert events[0].left_out == ()
    counts = [len(event.questions) for event in events if isinstance(event, AgentsChanged)]
    assert counts[:3] == [2, 1, 0]
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert set(outcome.comparison.rows) >= AGENTS
