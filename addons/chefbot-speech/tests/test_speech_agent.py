"""A page's talker before a real daemon: what brakes, what drives, and what does not."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from chefbot_speech.agent import SpeechAgent
from chefbot_speech.commands import Vocabulary
from chefbot_speech.recognition import Heard, Samples
from chefbot_speech.talker import PageTalker, Talkers

from chefbotd.client import Client, GoalNotReached
from chefbotd.client.models import AgentData, AgentsData, QuestionData
from chefbotd.clock import run_virtual
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.parameters import MapsParameters
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import load
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.components.maps.storage.test_store import grid
from tests.examples.waiter.guests import FakeDriving
from tests.fakes.worker import FakeChild, Nursery

PRESS = {"event": "press", "rate_hz": 16_000}
RELEASE = {"event": "release"}
YES = {"event": "answer", "choice": "yes"}


class FakeSpeaker:
    """Remembers what it is to say, and when it was hushed."""

    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []
        self.hushed: list[bool] = []

    def say(self, speaker: str, text: str) -> None:
        """Remember it."""
        self.said.append((speaker, text))

    def hush(self, *, is_hushed: bool) -> None:
        """Remember it."""
        self.hushed.append(is_hushed)


class FakeEar:
    """Hears what it is told, with a margin; knows every word."""

    def __init__(self) -> None:
        self.hears = Heard("", -1.0)
        self.grammars: list[str] = []
        self.samples = 0

    async def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """All of them."""
        return candidates

    async def recognize(self, samples: Samples, grammar: str) -> Heard:
        """As it was told."""
        self.grammars.append(grammar)
        self.samples = len(samples)
        return self.hears


class Room:
    """A robot whose worker only says that it drives, the speech agent, and a page."""

    def __init__(self, client: Client, drivings: list[FakeDriving], countdown_s: float | None) -> None:
        self.client, self.speaker, self.ear = client, FakeSpeaker(), FakeEar()
        self._drivings = drivings
        connect = partial(Client.connect, *client.address, name="speech")
        self.talkers = Talkers()
        self.agent = SpeechAgent(connect, self.speaker, self.ear, self.talkers.end_countdowns)  # type: ignore[arg-type]
        self.shown: list[dict[str, Any]] = []
        self.page, self.other = (
            PageTalker(self._show, self.agent, self.ear.recognize, self.talkers, countdown_s)
            for _ in range(2)
        )

    async def _show(self, state: dict[str, Any]) -> None:
        self.shown.append(state)

    @property
    def driven(self) -> list[float]:
        """The x of each goal that was driven to."""
        return [goal.x_m for driving in self._drivings for goal in driving.driven]

    async def goals(self) -> str:
        """What navigation does."""
        navigation = (await self.client.get_state()).topics["navigation"]
        return str(navigation.data.state)

    async def say(self, text: str, margin: float = 1.0) -> None:
        """Press, say it, release, and wait for what comes of it."""
        await self.page.take(PRESS)
        self.ear.hears = Heard(text, margin)
        self.page.add_sound(bytes(32_000))
        await self.page.take(RELEASE)
        await asyncio.sleep(0.5)


def in_room(
    folder: Path, scenario: Callable[[Room], Awaitable[None]], countdown_s: float | None = None
) -> None:
    """Run a scenario on the virtual clock."""
    save(MapStore(folder), "flat", grid(1))
    lidar = LidarParameters(name="top", model="ld19", device="/dev/absent")  # type: ignore[arg-type]
    settings = load().model_copy(update={"lidar": (lidar,), "maps": MapsParameters(folder=folder)})
    device = FakeSerialDevice()
    ScriptedBoard(device)
    drivings: list[FakeDriving] = []

    def raise_child(child: FakeChild) -> None:
        drivings.append(FakeDriving(child, 8.0))

    async def run() -> None:
        async with running_daemon(device, settings, spawn_worker=Nursery(raise_child).spawn) as client:
            await asyncio.sleep(1.5)
            await client.load_map("flat")
            for number in (1, 2, 3):
                await client.save_place(f"table {number}", float(number), 1.0, 0.0, kind="table")
            room = Room(client, drivings, countdown_s)
            working = asyncio.create_task(room.agent.run())
            await asyncio.sleep(0.5)
            await room.other.begin()
            await room.page.begin()
            await asyncio.wait_for(scenario(room), 600.0)
            await room.page.leave()
            await room.other.leave()
            working.cancel()
            await asyncio.gather(working, return_exceptions=True)

    run_virtual(run())


def test_a_place_is_driven_to_after_a_yes(tmp_path: Path) -> None:
    """Heard, shown and spoken it is a question; touched yes it is a goal, and its end is said."""

    async def scenario(room: Room) -> None:
        await room.say("please go to table two")
        assert room.shown[-1]["proposal"] == "table 2"
        assert room.speaker.said == [("speech", "Go to table 2? Say or touch yes.")]
        assert room.driven == []
        await room.page.take(YES)
        await asyncio.sleep(20.0)
        assert room.driven == [2.0]
        assert room.speaker.said[1:] == [("speech", "I am going to table 2."), ("speech", "I am at table 2.")]
        agents = (await room.client.get_state()).topics["agents"].data
        assert [(agent.name, agent.text) for agent in agents.agents] == [("speech", "I am at table 2.")]

    in_room(tmp_path, scenario)


def test_pressing_ends_the_goal_and_hushes_the_robot(tmp_path: Path) -> None:
    """The goal of whoever it is, in the same moment."""

    async def scenario(room: Room) -> None:
        driving = asyncio.create_task(room.client.navigate_to(place="table 3"))
        await asyncio.sleep(2.0)
        assert await room.goals() == "driving"
        await room.page.take(PRESS)
        with pytest.raises(GoalNotReached) as ended:
            await driving
        assert ended.value.cause == "stopped"
        assert room.speaker.hushed == [True]

    in_room(tmp_path, scenario)


def test_a_press_right_after_a_yes_leaves_the_robot_standing(tmp_path: Path) -> None:
    """Both messages arrive at once: no goal is sent behind the stop, while talk is held or after it."""

    async def scenario(room: Room) -> None:
        await room.say("go to table two")
        await room.page.take(YES)
        await room.page.take(PRESS)
        await asyncio.sleep(20.0)
        await room.page.take(RELEASE)
        await asyncio.sleep(20.0)
        assert room.driven == []

    in_room(tmp_path, scenario)


@pytest.mark.parametrize(
    ("said", "margin"),
    [("go to table two", -0.1), ("", -1.0), ("go to table", 1.0), ("go to table nine", 1.0), ("yes", 1.0)],
)
def test_what_is_not_understood_begins_nothing(tmp_path: Path, said: str, margin: float) -> None:
    """Unlikely, silent, half said, of no place here, and a yes to no question; also after a while and a yes."""

    async def scenario(room: Room) -> None:
        await room.say(said, margin)
        assert not room.shown[-1]["proposal"]
        await room.page.take(YES)
        await asyncio.sleep(60.0)
        assert room.driven == []

    in_room(tmp_path, scenario, countdown_s=5.0)


def test_a_spoken_yes_confirms_and_a_spoken_no_does_not(tmp_path: Path) -> None:
    """Both words are in the grammar then, and were not before."""

    async def scenario(room: Room) -> None:
        await room.say("go to table one")
        await room.say("no")
        await room.say("yes")
        await asyncio.sleep(20.0)
        assert room.driven == []
        await room.say("go to table three")
        await room.say("yes")
        await asyncio.sleep(20.0)
        assert room.driven == [3.0]
        assert ["yes" in grammar for grammar in room.ear.grammars] == [False, True, False, False, True]

    in_room(tmp_path, scenario)


def test_the_stop_of_the_page_ends_goal_countdown_and_proposal(tmp_path: Path) -> None:
    """The page is told whether it has arrived; nothing that was proposed begins afterwards."""

    async def scenario(room: Room) -> None:
        await room.say("go to table one")
        await room.page.take({"event": "answer", "choice": "yes"})
        await asyncio.sleep(1.0)
        assert await room.goals() == "driving"
        await room.page.take({"event": "stop"})
        assert (room.shown[-1]["stopped"], room.shown[-1]["text"]) == (True, "I stand.")
        await asyncio.sleep(1.0)
        assert await room.goals() == "cancelled"
        await room.say("go to table two")
        await room.page.take({"event": "stop"})
        await asyncio.sleep(20.0)
        assert room.driven == [1.0]

    in_room(tmp_path, scenario, countdown_s=5.0)


def test_a_countdown_begins_the_goal_and_a_touch_ends_it(tmp_path: Path) -> None:
    """5 s after the echo."""

    async def scenario(room: Room) -> None:
        await room.say("go to table one")
        await room.page.take({"event": "touch"})
        await asyncio.sleep(20.0)
        assert room.driven == []
        await room.say("go to table two")
        await asyncio.sleep(4.0)
        assert room.driven == []
        await asyncio.sleep(20.0)
        assert room.driven == [2.0]

    in_room(tmp_path, scenario, countdown_s=5.0)


@pytest.mark.parametrize("is_held_first", [False, True])
def test_while_somebody_talks_on_another_page_no_countdown_begins_a_goal(
    tmp_path: Path, *, is_held_first: bool
) -> None:
    """Pressed before or after the countdown has begun, and still held; nor after it was released."""

    async def scenario(room: Room) -> None:
        if is_held_first:
            await room.other.take(PRESS)
        await room.say("go to table two")
        if not is_held_first:
            await room.other.take(PRESS)
        await asyncio.sleep(20.0)
        assert room.driven == []
        room.ear.hears = Heard("", -1.0)
        await room.other.take(RELEASE)
        await asyncio.sleep(5.0)
        assert room.driven == []
        await room.page.take(YES)
        await asyncio.sleep(5.0)
        assert room.driven == [2.0]

    in_room(tmp_path, scenario, countdown_s=5.0)


def test_a_yes_while_somebody_talks_on_another_page_begins_nothing(tmp_path: Path) -> None:
    """Touched or spoken; the question is asked again."""

    async def scenario(room: Room) -> None:
        await room.say("go to table two")
        await room.other.take(PRESS)
        await room.page.take(YES)
        assert room.shown[-1]["text"] == "Somebody talks. Go to table 2? Say or touch yes."
        await room.say("yes")
        await asyncio.sleep(10.0)
        assert room.driven == []
        await room.other.leave()
        await room.page.take(YES)
        await asyncio.sleep(5.0)
        assert room.driven == [2.0]

    in_room(tmp_path, scenario)


def test_the_robot_is_silent_while_any_microphone_is_open(tmp_path: Path) -> None:
    """Until the last of two pages is released, or is gone."""

    async def scenario(room: Room) -> None:
        for page in (room.page, room.other):
            await page.take(PRESS)
        await room.page.take(RELEASE)
        assert room.speaker.hushed == [True, True, True]
        await room.other.take(RELEASE)
        assert room.speaker.hushed[3:] == [False]
        await room.other.take(PRESS)
        await room.other.leave()
        assert room.speaker.hushed[4:] == [True, False]

    in_room(tmp_path, scenario)


@pytest.mark.parametrize("is_estop", [False, True])
def test_whoever_stops_the_robot_ends_the_countdown(tmp_path: Path, *, is_estop: bool) -> None:
    """A goal that is stopped on another page, and an emergency stop that is released before the countdown's end."""

    async def scenario(room: Room) -> None:
        await room.say("go to table two")
        if is_estop:
            await room.client.estop()
            await asyncio.sleep(1.0)
            await room.client.arm()
        else:
            driving = asyncio.create_task(room.client.navigate_to(place="table 3"))
            await asyncio.sleep(2.0)
            await room.client.cancel_navigation()
            with pytest.raises(GoalNotReached):
                await driving
        driven = list(room.driven)
        await asyncio.sleep(20.0)
        assert room.driven == driven
        assert room.shown[-1]["proposal"] == "table 2"

    in_room(tmp_path, scenario, countdown_s=5.0)


@pytest.mark.parametrize("what", ["estop", "stop"])
def test_a_stop_while_the_sentence_is_recognized_leaves_no_countdown(tmp_path: Path, what: str) -> None:
    """Somebody stops the robot, and arms it, before it is understood: it asks for a yes, and goes by that."""

    async def scenario(room: Room) -> None:
        understood = asyncio.Event()
        hear = room.ear.recognize

        async def late(samples: Samples, grammar: str) -> Heard:
            await understood.wait()
            return await hear(samples, grammar)

        room.page._recognize = late
        await room.say("go to table two")
        await room.client.call(what)
        await room.client.arm()
        await asyncio.sleep(0.2)
        understood.set()
        await asyncio.sleep(20.0)
        assert (room.driven, room.shown[-1]["proposal"]) == ([], "table 2")
        assert room.shown[-1]["text"] == "Go to table 2? Say or touch yes."
        await room.page.take(YES)
        await asyncio.sleep(10.0)
        assert room.driven == [2.0]

    in_room(tmp_path, scenario, countdown_s=2.0)


@pytest.mark.slow
def test_at_each_of_100_moments_an_estop_while_the_sentence_is_recognized_leaves_no_countdown(
    tmp_path: Path,
) -> None:
    """It is recognized for 2 s; an e-stop and an arm in each 0.02 s of them: 100 of 100 ask for a yes."""

    async def scenario(room: Room) -> None:
        hear = room.ear.recognize

        async def late(samples: Samples, grammar: str) -> Heard:
            await asyncio.sleep(2.0)
            return await hear(samples, grammar)

        room.page._recognize = late
        for number in range(100):
            await room.say("go to table two")
            await asyncio.sleep(0.015 * number)
            await room.client.estop("a child")
            await room.client.arm()
            await asyncio.sleep(4.6 - 0.015 * number)  # past the countdown's end
            assert (room.driven, room.shown[-1]["proposal"]) == ([], "table 2"), number

    in_room(tmp_path, scenario, countdown_s=2.0)


def test_a_goal_that_is_sent_before_a_stop_is_heard_of_is_refused(tmp_path: Path) -> None:
    """A yes in the moment of an emergency stop that is armed at once: the daemon compares the number."""

    async def scenario(room: Room) -> None:
        await room.say("go to table two")
        before = room.agent._stop_number
        await room.client.estop("a child")
        await room.client.arm()
        room.agent._stop_number = before
        await room.page.take(YES)
        await asyncio.sleep(10.0)
        assert room.driven == []
        assert any("I cannot go to table 2" in text for _, text in room.speaker.said)

    in_room(tmp_path, scenario)


def test_a_page_that_is_gone_begins_nothing(tmp_path: Path) -> None:
    """Its countdown ends with it."""

    async def scenario(room: Room) -> None:
        await room.say("go to table one")
        await room.page.leave()
        await asyncio.sleep(20.0)
        assert room.driven == []

    in_room(tmp_path, scenario, countdown_s=5.0)


def test_who_talks_too_long_is_not_understood(tmp_path: Path) -> None:
    """More than 8 s: its beginning is not taken for all of it."""

    async def scenario(room: Room) -> None:
        room.ear.hears = Heard("go to table two", 1.0)
        await room.page.take(PRESS)
        for _ in range(100):
            room.page.add_sound(bytes(4096))
        await room.page.take(RELEASE)
        await asyncio.sleep(0.5)
        assert room.shown[-1]["text"] == "I did not understand. I stay here."
        assert room.ear.grammars == []

    in_room(tmp_path, scenario)


def test_a_new_press_makes_what_was_said_before_void(tmp_path: Path) -> None:
    """Although it is recognized only then."""

    async def scenario(room: Room) -> None:
        gate = asyncio.Event()
        hear = room.ear.recognize

        async def late(samples: Samples, grammar: str) -> Heard:
            await gate.wait()
            return await hear(samples, grammar)

        room.page._recognize = late
        await room.say("go to table two")
        await room.page.take(PRESS)
        gate.set()
        await asyncio.sleep(0.5)
        assert not room.shown[-1]["proposal"]

    in_room(tmp_path, scenario)


def test_without_the_daemon_a_press_says_that_nothing_stops() -> None:
    """It does not look as if the robot had been stopped."""

    async def run() -> None:
        shown: list[dict[str, Any]] = []

        async def show(state: dict[str, Any]) -> None:
            shown.append(state)

        speaker, ear = FakeSpeaker(), FakeEar()
        agent = SpeechAgent(Client.connect, speaker, ear)  # type: ignore[arg-type]
        await PageTalker(show, agent, ear.recognize, Talkers()).take(PRESS)
        assert shown[-1]["text"] == "The robot's daemon is not connected: I cannot stop it."
        assert await agent.vocabulary() == Vocabulary.of([])

    asyncio.run(run())


def test_what_agents_say_and_ask_is_spoken_once() -> None:
    """Each sentence when it is new, each question once, and nothing of its own."""
    speaker = FakeSpeaker()
    agent = SpeechAgent(Client.connect, speaker, FakeEar())  # type: ignore[arg-type]
    waiter, own = AgentData("waiter", "1", (), "I am coming"), AgentData("speech", "1", (), "I stand")
    question = QuestionData(7, "waiter", "Please take your food", ("Taken",))
    agent.take_agents(AgentsData((waiter, own), (), ()))
    agent.take_agents(AgentsData((waiter, own), (), (question,)))
    agent.take_agents(AgentsData((waiter, own), (), (question,)))
    assert speaker.said == [("waiter", "I am coming"), ("waiter's question", "Please take your food")]
