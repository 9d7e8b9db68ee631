"""The agent ``speech`` of a daemon: says aloud what agents say, and sends the robot to places."""

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from typing import Any, Final

import structlog

from chefbot_speech.commands import KINDS, Vocabulary, spoken
from chefbot_speech.ear import Ear
from chefbot_speech.speaker import Speaker
from chefbotd.client import CallError, ChefbotError, Client, GoalNotReached
from chefbotd.client.models import AgentsData, NavigationData, SafetyData
from chefbotd.components.agents.agent import BY_PEOPLE

log = structlog.get_logger("speech")
NAME, VERSION = "speech", "0.1"
ARMED: Final = "armed"
AGAIN_S: Final = 2.0
LONGEST_TEXT: Final = 200
QUIET_ENDS: Final = {"stopped", "replaced", "asked"}
"""Causes of a goal's end that somebody has brought about who knows it."""

NOT_CONNECTED: Final = "The robot's daemon is not connected: I cannot stop it."
Connect = Callable[[], AbstractAsyncContextManager[Client]]


class SpeechAgent:
    """``run`` keeps it connected; a talker may use it meanwhile.

    ``stopped`` is called when the robot is stopped by anybody but this program, or has a fault.
    """

    def __init__(
        self, connect: Connect, speaker: Speaker, ear: Ear, stopped: Callable[[], None] = lambda: None
    ) -> None:
        self._connect, self._speaker, self._ear, self._stopped = connect, speaker, ear, stopped
        self._robot: Client | None = None
        self._stop_number: int | None = None  # of the last stop or fault that is known, or was our own
        self._own_stops, self._heard_meanwhile = 0, 0  # under way, and the latest number since they began
        self._texts: dict[str, str] = {}
        self._questions: set[int] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._going: asyncio.Task[None] | None = None
        self._known: dict[frozenset[str], frozenset[str]] = {}

    async def run(self) -> None:
        """Be the agent until cancelled; a lost connection is opened again."""
        while True:
            try:
                async with self._connect() as robot:
                    await robot.register_agent(NAME, VERSION)
                    self._robot = robot
                    await self._listen(robot)
            except (ChefbotError, TimeoutError) as problem:
                log.warning("the connection is opened again", why=str(problem))
            finally:
                self._robot = None
                self._questions.clear()
                self._stopped()  # who stops the robot is not seen meanwhile
            await asyncio.sleep(AGAIN_S)

    async def _listen(self, robot: Client) -> None:
        async with robot.subscribe(["agents", "navigation", "safety"], policy="ordered") as events:
            async for event in events:
                match event.data:
                    case AgentsData():
                        self.take_agents(event.data)
                    case SafetyData(mode=mode, stop_number=stop_number):
                        self._take_safety(mode, stop_number)
                    case NavigationData(cause=cause) if cause in BY_PEOPLE:
                        self._stopped()

    def _take_safety(self, mode: str, stop_number: int) -> None:
        if self._own_stops:
            self._heard_meanwhile = stop_number
        has_stopped = not self._own_stops and stop_number != self._stop_number
        if has_stopped:
            self._stop_number = stop_number
        if has_stopped or mode != ARMED:
            self._stopped()

    def take_agents(self, data: AgentsData) -> None:
        """Say what is new of the other agents: their sentences and their questions."""
        for agent in data.agents:
            if agent.name != NAME and agent.text and agent.text != self._texts.get(agent.name):
                self._speaker.say(agent.name, agent.text)
        self._texts = {agent.name: agent.text for agent in data.agents}
        for question in data.questions:
            if question.question_id not in self._questions:
                self._speaker.say(f"{question.agent}'s question", question.question)
        self._questions = {question.question_id for question in data.questions}

    async def stop(self) -> str:
        """Brake; why it cannot be asked for, or nothing. A goal that was not sent yet is not sent any more."""
        if self._going is not None:
            self._going.cancel()
        robot = self._robot
        if robot is None:
            return NOT_CONNECTED
        self._own_stops += 1
        try:
            own = int((await robot.call("stop")).get("stop_number", 0))
        except ChefbotError as problem:
            self._stopped()  # nothing begins by itself
            return f"I could not stop: {problem}"
        finally:
            self._own_stops -= 1
        heard, self._heard_meanwhile = self._heard_meanwhile, 0
        self._stop_number = max(own, heard)
        if heard > own:
            self._stopped()
        return ""

    def go(self, place: str) -> None:
        """Go to a place, and say what becomes of it; a stop that is not known here yet keeps the robot from it."""
        self._going = self._begin(self._go(place, self._stop_number))

    def say(self, text: str) -> None:
        """Say it aloud, and on the robot's page."""
        self._speaker.say(NAME, text)
        self._begin(self._show(text))

    def hush(self, *, is_hushed: bool) -> None:
        """Be silent from now on, or not any more."""
        self._speaker.hush(is_hushed=is_hushed)

    async def vocabulary(self) -> Vocabulary:
        """The places of the map in use as they are now; none where there are none."""
        robot = self._robot
        try:
            places = (await robot.list_places()).places if robot is not None else ()
        except ChefbotError as problem:
            log.warning("no_places", why=str(problem))
            places = ()
        wanted = frozenset(
            word for place in places if place.kind in KINDS for word in spoken(place.name).split()
        )
        if wanted not in self._known:
            self._known = {wanted: await self._ear.words(wanted)}
        return Vocabulary.of(places, self._known[wanted])

    def _begin(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _go(self, place: str, stop_number: int | None) -> None:
        robot = self._robot
        if robot is None:
            return self.say("I cannot go: the robot's daemon is not connected.")
        try:
            goal_id = f"speech-{secrets.token_hex(4)}"
            await robot.navigate_to(
                place=place, goal_id=goal_id, on_client_left="cancel", if_stop_number=stop_number
            )
            text = f"I am at {place}."
        except GoalNotReached as ended:
            text = "" if ended.cause in QUIET_ENDS else f"I did not reach {place}: {ended.reason}"
        except CallError as refused:
            text = f"I cannot go to {place}: {refused.message}"
        except ChefbotError as problem:
            text = f"I have lost the robot: {problem}"
        if text:
            self.say(text)
        return None

    async def _show(self, text: str) -> None:
        robot = self._robot
        if robot is not None:
            with contextlib.suppress(ChefbotError):  # who speaks too often is still heard
                await robot.say(" ".join(text.split())[:LONGEST_TEXT])
