"""What every agent needs: sentences, buttons, goals that wait, and a connection that comes again."""

import asyncio
from contextlib import AbstractAsyncContextManager

import pytest

from chefbotd.client import CallError, Client, GoalNotReached
from chefbotd.clock import run_virtual
from chefbotd.components.agents.agent import (
    ACCIDENTS,
    BY_PEOPLE,
    CAUSES,
    LONGEST_TEXT,
    TEMPORARY,
    Agent,
    run_agent,
)
from chefbotd.components.navigation.events import GoalCause
from chefbotd.core.commands import RefusalKind
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice


def test_what_is_temporary_and_what_is_an_accident_are_kinds_that_the_daemon_has() -> None:
    """A kind that was renamed would be refused for good without a word."""
    assert {*map(str, RefusalKind), *map(str, ErrorKind)} >= TEMPORARY | CAUSES.keys()
    assert set(map(str, GoalCause)) >= ACCIDENTS | BY_PEOPLE
    assert not ACCIDENTS & BY_PEOPLE


def test_a_long_sentence_is_cut_and_one_too_many_is_not_said() -> None:
    """Twenty at once: the first ten are said, as the daemon allows, and none of them raises an error."""

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice()) as robot:
            await robot.register_agent("bard", "1")
            agent = Agent(robot, "bard")
            await agent.say("x" * 500)
            assert (await robot.get_state()).agents.agents[0].text == "x" * (LONGEST_TEXT - 1) + "…"
            for number in range(20):
                await agent.say(str(number))
            assert (await robot.get_state()).agents.agents[0].text == "8"

    run_virtual(scenario())


def test_another_refusal_of_a_sentence_is_raised() -> None:
    """Who is no agent cannot speak."""

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice()) as robot:
            with pytest.raises(CallError, match="has to register first"):
                await Agent(robot, "nobody").say("hello")

    run_virtual(scenario())


def test_each_press_is_what_stands_behind_its_label() -> None:
    """Two buttons of this agent, and one of another, which is not seen."""

    async def scenario() -> None:
        async with (
            running_daemon(FakeSerialDevice()) as guest,
            Client.connect(*guest.address) as one,
            Client.connect(*guest.address) as two,
        ):
            await one.register_agent("one", "1")
            await two.register_agent("two", "1")
            other = await two.add_button("Other")
            presses = Agent(one, "one").presses({"A": 1, "B": 2})
            first = asyncio.ensure_future(anext(presses))
            await asyncio.sleep(0.5)
            labels = {button.label: button.button_id for button in (await guest.get_state()).agents.buttons}
            for number in (labels["B"], other.button_id, labels["A"]):
                await guest.press_button(number)
            assert [await first, await anext(presses)] == [2, 1]

    run_virtual(scenario())


class RefusingRobot:
    """Refuses goals, each with the next of these kinds, and then lets it drive there."""

    def __init__(self, *kinds: str) -> None:
        self.kinds, self.said, self.goals = list(kinds), list[str](), list[str | None]()

    async def navigate_to(self, *, place: str, goal_id: str, on_client_left: str) -> str:
        """As the client's."""
        self.goals.append(goal_id)
        if self.kinds:
            raise CallError(-1, kind := self.kinds.pop(0), f"because of {kind}")
        return "reached"

    async def say(self, text: str) -> None:
        """As the client's."""
        self.said.append(text)


def test_a_goal_waits_where_the_robot_cannot_move_now() -> None:
    """It says why each time, and asks with the same id every 2 s."""
    robot = RefusingRobot("link_down", "pose_unknown")

    async def scenario() -> float:
        began_s = asyncio.get_running_loop().time()
        await Agent(robot, "a").drive_to("table 1", "goal-7")  # type: ignore[arg-type]
        return asyncio.get_running_loop().time() - began_s

    assert run_virtual(scenario()) == pytest.approx(4.0)
    assert robot.goals == ["goal-7"] * 3
    assert robot.said == ["I have to wait: because of link_down", "I have to wait: because of pose_unknown"]


def test_a_goal_that_waits_is_void_once_the_robot_was_stopped() -> None:
    """Each try names the stop that was known when it was decided, also where the agent knows of a later one by then."""
    numbers: list[int | None] = []

    class Stopped(RefusingRobot):
        async def navigate_to(self, *, if_stop_number: int | None = None, **goal: str) -> str:
            numbers.append(if_stop_number)
            agent.stop_number = 8
            return await super().navigate_to(**goal)

    agent = Agent(Stopped("pose_unknown", "stopped_since"), "a")  # type: ignore[arg-type]
    agent.stop_number = 7
    with pytest.raises(GoalNotReached) as ended:
        run_virtual(agent.drive_to("table 1", "goal-1"))
    assert (numbers, ended.value.cause) == ([7, 7], "stopped")


def test_a_goal_that_is_refused_for_good_ends() -> None:
    """Such as a place that there is not."""
    robot = RefusingRobot("unknown_place")
    with pytest.raises(GoalNotReached, match="because of unknown_place") as refused:
        run_virtual(Agent(robot, "a").drive_to("table 9", "goal-8"))  # type: ignore[arg-type]
    assert refused.value.end == "refused"


@pytest.mark.parametrize(("kind", "cause"), CAUSES.items())
def test_a_goal_that_somebody_stopped_is_not_sent_again(kind: str, cause: str) -> None:
    """It ends as one that was stopped on the way."""
    robot = RefusingRobot(kind)
    with pytest.raises(GoalNotReached) as refused:
        run_virtual(Agent(robot, "a").drive_to("table 1", "goal-9"))  # type: ignore[arg-type]
    assert (refused.value.cause, refused.value.cause in BY_PEOPLE) == (cause, True)
    assert robot.goals == ["goal-9"]


def test_an_agent_whose_connection_is_lost_registers_and_begins_again() -> None:
    """Until its work returns; another error than the client's is raised."""
    begun: list[str] = []

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice()) as robot:

            def connect() -> AbstractAsyncContextManager[Client]:
                return Client.connect(*robot.address)

            async def work(agent: Agent) -> None:
                begun.append((await robot.get_state()).agents.agents[0].name)
                if len(begun) == 1:
                    raise TimeoutError("no answer")

            await run_agent(connect, "again", "1.0", work)

            async def broken(agent: Agent) -> None:
                raise KeyError("a bug")

            with pytest.raises(KeyError):
                await run_agent(connect, "broken", "1.0", broken)

    run_virtual(scenario())
    assert begun == ["again", "again"]
