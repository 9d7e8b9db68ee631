"""Agents on the socket: what they may do, who may answer, and what is left of them when they leave."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.settings import load
from chefbotd.testing.daemon import simulated_robot

TOKENS = {role: f"{role:x<16}" for role in ("observe", "guest", "agent", "drive")}


class Connect:
    """Connects clients to a robot; each can leave."""

    def __init__(self, where: tuple[str, int]) -> None:
        self._where = where
        self._connected: dict[Client, AsyncExitStack] = {}

    async def __call__(self, role: str = "", name: str = "") -> Client:
        stack = AsyncExitStack()
        connecting = Client.connect(*self._where, token=TOKENS.get(role), name=name or None)
        client = await stack.enter_async_context(connecting)
        self._connected[client] = stack
        return client

    async def leave(self, client: Client) -> None:
        """Its connection ends."""
        await self._connected.pop(client).aclose()
        await asyncio.sleep(0.1)

    async def leave_all(self) -> None:
        """Every connection ends."""
        for client in list(self._connected):
            await self.leave(client)


def with_clients(scenario: Callable[[Connect], Awaitable[None]], tmp_path: Path | None = None) -> None:
    """Run a scenario that connects clients to a robot; with a folder, each with the token of its role."""
    settings = load()
    if tmp_path is not None:
        tokens = tmp_path / "tokens"
        tokens.write_text("".join(f"{role} {token}\n" for role, token in TOKENS.items()))
        tokens.chmod(0o600)
        settings = load(overrides={"api.token_file": str(tokens)})

    async def run() -> None:
        token = None if tmp_path is None else TOKENS["observe"]
        async with simulated_robot(settings, token=token) as robot:
            connect = Connect(await robot.daemon.server.address())
            try:
                await asyncio.wait_for(scenario(connect), 600.0)
            finally:
                await connect.leave_all()

    run_virtual(run())


async def kind_of(request: Awaitable[Any]) -> str:
    """The kind of a refusal."""
    with pytest.raises(CallError) as refused:
        await request
    return refused.value.kind


async def first(events: Any) -> Any:
    """The next event's data."""
    return (await asyncio.wait_for(anext(events), 5.0)).data


def test_a_name_belongs_to_one_connection_until_that_ends() -> None:
    """Again by the same one is another version; by another it is refused while the first lives, then taken."""

    async def scenario(connect: Connect) -> None:
        one, other = await connect(), await connect()
        await one.register_agent("waiter", "1.0")
        await one.register_agent("waiter", "1.1")
        with pytest.raises(CallError, match="another agent is called 'waiter' already") as refused:
            await other.register_agent("waiter", "2.0")
        assert refused.value.kind == "agent_exists"
        assert await kind_of(one.register_agent("cook", "1.0")) == "agent_exists"
        assert [(each.name, each.version) for each in (await other.get_state()).agents.agents] == [
            ("waiter", "1.1")
        ]
        await connect.leave(one)
        await other.register_agent("waiter", "2.0")

    with_clients(scenario)


def test_what_an_agent_says_is_in_the_topic_and_in_the_log() -> None:
    """The last sentence of each agent; a client that is no agent is told to register."""

    async def scenario(connect: Connect) -> None:
        agent, looker = await connect(), await connect()
        assert await kind_of(agent.say("hello")) == "not_an_agent"
        await agent.register_agent("waiter", "1.0")
        await agent.say("I go to table 3")
        await agent.say("I am there")
        state = await looker.get_state()
        assert [(each.name, each.text) for each in state.agents.agents] == [("waiter", "I am there")]
        lines = [(line.source, line.text) for line in state.topics["log"].data.lines]
        assert lines[-2:] == [("waiter", "I go to table 3"), ("waiter", "I am there")]

    with_clients(scenario)


def test_an_agent_speaks_ten_times_at_once_and_twice_a_second() -> None:
    """The eleventh sentence is refused; a second later two more are said, and no third."""

    async def scenario(connect: Connect) -> None:
        agent = await connect()
        await agent.register_agent("waiter", "1.0")
        for number in range(10):
            await agent.say(f"sentence {number}")
        assert await kind_of(agent.say("one too many")) == "rate_limited"
        await asyncio.sleep(1.0)
        await agent.say("a")
        await agent.say("b")
        assert await kind_of(agent.say("c")) == "rate_limited"

    with_clients(scenario)


def test_a_question_is_answered_by_the_first_choice_of_anybody() -> None:
    """A choice that is none of them is refused and named; the second answer comes too late."""

    async def scenario(connect: Connect) -> None:
        agent, guest = await connect(), await connect(name="Ann's phone")
        await agent.register_agent("waiter", "1.0")
        asking = asyncio.create_task(agent.ask("Taken?", ["yes", "not yet"], 30.0))
        await asyncio.sleep(0.1)
        (question,) = (await guest.get_state()).agents.questions
        assert (question.agent, question.question) == ("waiter", "Taken?")
        assert list(question.choices) == ["yes", "not yet"]
        with pytest.raises(CallError, match="'maybe' is none of the choices: yes, not yet"):
            await guest.answer_agent(question.question_id, "maybe")
        await guest.answer_agent(question.question_id, "not yet")
        answer = await asking
        assert answer.choice == "not yet"
        assert answer.by.startswith("Ann's phone")
        assert (await guest.get_state()).agents.questions in ((), [])
        assert await kind_of(guest.answer_agent(question.question_id, "yes")) == "unknown_question"

    with_clients(scenario)


def test_a_question_that_nobody_answers_ends_with_its_time() -> None:
    """After 20 s, for which a client waits although it gives up what is silent for 5 s; nothing is left of it."""

    async def scenario(connect: Connect) -> None:
        agent = await connect()
        await agent.register_agent("waiter", "1.0")
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        assert (await agent.ask("Taken?", ["yes"], 20.0)).choice is None
        assert loop.time() - began_s == pytest.approx(20.0, abs=0.1)
        assert not (await agent.get_state()).agents.questions

    with_clients(scenario)


def test_a_question_ends_in_time_at_whatever_moment_it_began() -> None:
    """Odd moments and odd times: sums of such numbers are not exact, and a timer may be early by a rounding."""

    async def scenario(connect: Connect) -> None:
        agent = await connect()
        await agent.register_agent("waiter", "1.0")
        loop = asyncio.get_running_loop()
        for number in range(40):
            await asyncio.sleep(0.0137 * number)
            began_s, timeout_s = loop.time(), 0.1 + 0.307 * number
            assert (await agent.ask("Taken?", ["yes"], timeout_s)).choice is None
            assert loop.time() - began_s == pytest.approx(timeout_s, abs=0.01)

    with_clients(scenario)


def test_a_question_that_its_agent_gives_up_is_gone() -> None:
    """The request is cancelled; the agent lives on."""

    async def scenario(connect: Connect) -> None:
        agent = await connect()
        await agent.register_agent("waiter", "1.0")
        asking = asyncio.create_task(agent.ask("Taken?", ["yes"]))
        await asyncio.sleep(0.1)
        assert (await agent.get_state()).agents.questions
        asking.cancel()
        await asyncio.sleep(0.1)
        state = await agent.get_state()
        assert not state.agents.questions
        assert [each.name for each in state.agents.agents] == ["waiter"]

    with_clients(scenario)


def test_a_press_comes_to_its_agent_and_no_old_one_to_the_next() -> None:
    """Two presses, in order, by whom; who subscribes later gets neither, so that no order is served twice."""

    async def scenario(connect: Connect) -> None:
        agent, guest = await connect(), await connect(name="Ann's phone")
        await agent.register_agent("waiter", "1.0")
        tables = [(await agent.add_button(f"Table {number}")).button_id for number in (1, 2)]
        async with agent.subscribe("agent_events") as events:
            for button_id in reversed(tables):
                await guest.press_button(button_id)
            told = [await first(events), await first(events)]
        assert [(each.agent, each.event, each.label, each.button_id) for each in told] == [
            ("waiter", "pressed", "Table 2", tables[1]),
            ("waiter", "pressed", "Table 1", tables[0]),
        ]
        assert told[0].by.startswith("Ann's phone")
        async with guest.subscribe("agent_events") as events:
            with pytest.raises(TimeoutError):
                await first(events)
        assert "agent_events" not in (await guest.get_state()).topics
        await agent.remove_button(tables[0])
        assert await kind_of(guest.press_button(tables[0])) == "unknown_button"

    with_clients(scenario)


def test_a_button_is_taken_back_by_its_own_agent_alone() -> None:
    """Another one is told whose it is."""

    async def scenario(connect: Connect) -> None:
        one, other = await connect(), await connect()
        await one.register_agent("waiter", "1.0")
        await other.register_agent("cook", "1.0")
        button_id = (await one.add_button("Table 1")).button_id
        with pytest.raises(CallError, match="the button 'Table 1' belongs to the agent 'waiter'"):
            await other.remove_button(button_id)

    with_clients(scenario)


def test_a_call_is_answered_by_the_agent_or_fails_by_name() -> None:
    """Its result, its own error, no answer in time, no such method, no such agent, and one that leaves."""

    async def scenario(connect: Connect) -> None:
        cook, waiter = await connect(), await connect(name="waiter's")
        await cook.register_agent("cook", "1.0", ["cook", "taste"])
        async with cook.subscribe("agent_events") as events:

            async def call(method: str, **answer: Any) -> Any:
                calling = asyncio.create_task(waiter.call_agent("cook", method, {"dish": "soup"}, 3.0))
                told = await first(events)
                assert (told.event, told.method, told.params) == ("called", method, {"dish": "soup"})
                if answer:
                    await cook.answer_call(told.call_id, **answer)
                return await calling

            assert (await call("cook", result={"minutes": 4})).result == {"minutes": 4}
            with pytest.raises(CallError, match="no salt") as failed:
                await call("taste", error="there is no salt")
            assert failed.value.kind == "agent_failed"
            assert await kind_of(call("taste")) == "agent_timed_out"
            assert await kind_of(waiter.call_agent("cook", "sing")) == "unknown_agent"
            assert await kind_of(waiter.call_agent("nobody", "cook")) == "unknown_agent"
            assert await kind_of(cook.answer_call(4711)) == "unknown_call"
            calling = asyncio.create_task(waiter.call_agent("cook", "cook"))
            await first(events)
        await connect.leave(cook)
        assert await kind_of(calling) == "agent_left"

    with_clients(scenario)


def test_everything_of_an_agent_vanishes_with_its_connection() -> None:
    """Its name, its buttons and its question, and nothing of another one's."""

    async def scenario(connect: Connect) -> None:
        one, other = await connect(), await connect()
        for agent, name in ((one, "waiter"), (other, "cook")):
            await agent.register_agent(name, "1.0")
            await agent.add_button(f"{name}'s")
        asking = asyncio.create_task(one.ask("Taken?", ["yes"]))
        await asyncio.sleep(0.1)
        await connect.leave(one)
        await asyncio.wait([asking])
        await asyncio.sleep(0.1)
        agents = (await other.get_state()).agents
        assert [each.name for each in agents.agents] == ["cook"]
        assert [each.label for each in agents.buttons] == ["cook's"]
        assert not agents.questions
        asking.exception()

    with_clients(scenario)


def test_what_an_agent_publishes_comes_to_whoever_subscribes() -> None:
    """As it was, and with the agent's name."""

    async def scenario(connect: Connect) -> None:
        agent, looker = await connect(), await connect()
        await agent.register_agent("waiter", "1.0")
        async with looker.subscribe("agent_data") as events:
            await agent.publish_to_topic("orders", {"open": [3, 1], "note": "ä"})
            told = await first(events)
        assert (told.agent, told.topic, told.data) == ("waiter", "orders", {"open": [3, 1], "note": "ä"})

    with_clients(scenario)


def test_nonsense_is_refused_with_the_value() -> None:
    """Names, texts, choices, numbers and data that are empty, too long, too many, doubled or not printable."""

    async def scenario(connect: Connect) -> None:
        agent = await connect()
        await agent.register_agent("waiter", "1.0")
        for request, said in (
            (agent.register_agent("", "1.0"), "name: .*got ''"),
            (agent.register_agent("w\n", "1.0"), r"name: .*got 'w\\n'"),
            (agent.register_agent("waiter", "v" * 33), "version: .*at most 32 characters"),
            (agent.register_agent("waiter", "1", ["m"] * 17), "methods: .*at most 16 items"),
            (agent.say("x" * 201), "text: .*at most 200 characters"),
            (agent.say("a\x1b[2J"), "text: expected text without control characters"),
            (agent.ask("Well?", []), "choices: .*at least 1 item"),
            (agent.ask("Well?", ["yes", "yes"]), "choices: expected each choice once"),
            (agent.ask("Well?", ["yes"], 3601.0), "timeout_s: .*got 3601.0"),
            (agent.add_button("b" * 41), "label: .*at most 40 characters"),
            (agent.press_button(0), "button_id: .*got 0"),
            (agent.publish_to_topic("t", {"x": "y" * 2048}), "data: expected at most 2048 bytes"),
        ):
            with pytest.raises(CallError, match=said) as refused:
                await request
            assert refused.value.kind == "invalid_params"

    with_clients(scenario)


def test_nothing_is_without_a_limit() -> None:
    """16 agents; of each 32 buttons and 4 questions; of one more it is said how many there are."""

    async def scenario(connect: Connect) -> None:
        agents = [await connect() for _ in range(17)]
        for number, agent in enumerate(agents[:16]):
            await agent.register_agent(f"agent {number}", "1.0")
        with pytest.raises(CallError, match="at most 16 agents are allowed, and there are 16"):
            await agents[16].register_agent("agent 16", "1.0")
        for number in range(32):
            await agents[0].add_button(f"button {number}")
        with pytest.raises(CallError, match="at most 32 buttons of an agent"):
            await agents[0].add_button("one more")
        asked = [asyncio.create_task(agents[0].ask("Well?", ["yes"], 9.0)) for _ in range(4)]
        await asyncio.sleep(0.1)
        with pytest.raises(CallError, match="at most 4 questions of an agent"):
            await agents[0].ask("Well?", ["yes"])
        await asyncio.gather(*asked)

    with_clients(scenario)


def test_a_guest_answers_and_presses_and_an_agent_neither_drives_nor_tunes(tmp_path: Path) -> None:
    """Who only observes changes nothing; a guest orders; an agent may be sent to goals, which need a map here."""

    async def scenario(connect: Connect) -> None:
        agent, guest, looker = [await connect(role) for role in ("agent", "guest", "observe")]
        await agent.register_agent("waiter", "1.0")
        button_id = (await agent.add_button("Table 1")).button_id
        await guest.press_button(button_id)
        assert await kind_of(looker.press_button(button_id)) == "forbidden"
        assert await kind_of(looker.answer_agent(1, "yes")) == "forbidden"
        assert await kind_of(guest.register_agent("Ann", "1.0")) == "forbidden"
        for request in (
            agent.drive(0.1, 0.0),
            agent.arm(),
            agent.set_pid("all", kp=1.0),
            agent.take_control(),
        ):
            assert await kind_of(request) == "forbidden"
        await guest.stop()

    with_clients(scenario, tmp_path)


def test_a_storm_of_registrations_is_told_ten_times_a_second() -> None:
    """Of an agent with 32 buttons, 2,000 times: the topic has 50 at once and 10 a second at most, and the last state."""

    async def scenario(connect: Connect) -> None:
        watcher, agent = await connect(), await connect()
        await agent.register_agent("storm", "0")
        for number in range(32):
            await agent.add_button(f"button {number}")
        versions: list[str] = []

        async def watch() -> None:
            async with watcher.subscribe("agents", policy="ordered") as events:
                async for event in events:
                    versions.append(event.data.agents[0].version)  # noqa: PERF401 - it never ends

        watching = asyncio.create_task(watch())
        await asyncio.sleep(10.0)
        versions.clear()
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        for number in range(2000):
            await agent.register_agent("storm", str(number))
            await asyncio.sleep(0.0005)
        took_s = loop.time() - began_s
        await asyncio.sleep(1.0)
        assert versions[-1] == "1999"
        assert len(versions) <= 50 + 10 * (took_s + 1.0) + 1
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)

    with_clients(scenario)
