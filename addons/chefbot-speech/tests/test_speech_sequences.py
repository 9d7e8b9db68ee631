"""Random sequences of sentences, answers, stops, faults and lost connections: no goal from before a stop is driven to.

The talkers of two pages and the agent are the real ones; the robot stands for its daemon, requests and what it tells are
on their way for a while, and recognition takes its time. ``make sequences SEQUENCES=1000000`` runs more of them.
"""

import asyncio
import os
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any, cast

import pytest
from chefbot_speech.agent import SpeechAgent
from chefbot_speech.recognition import Heard
from chefbot_speech.talker import PageTalker, Talkers
from test_speech_agent import PRESS, RELEASE, YES, FakeEar, FakeSpeaker

from chefbotd.client import CallError, Client, ConnectionLost
from chefbotd.client.models import SafetyData
from tests.fakes.sequences import run_sequences

LENGTH = 16
ON_ITS_WAY_S, HEARS_FOR_S, COUNTDOWN_S, DRIVES_S = 0.15, 1.0, 2.0, 8.0
SENTENCE = "go to table two"
DEEDS = (
    *("sentence", "sentence", "sentence", "press", "release", "yes", "yes", "other page's sentence"),
    *("stop of another", "fault", "arm", "arm", "page's stop", "away", "back", "back"),
    *("slow line", "fast line", "slow ear", "fast ear", "wait", "wait", "wait long"),
)


class SlowEar(FakeEar):
    """It takes ``hears_for_s`` to understand."""

    hears_for_s = 0.0

    async def recognize(self, samples: Any, grammar: str) -> Heard:
        """As it was told."""
        await asyncio.sleep(self.hears_for_s)
        return await super().recognize(samples, grammar)


class Robot:
    """``stops`` counts what has stopped it, as its daemon does; ``decided_at`` is that count at the last decision."""

    def __init__(self) -> None:
        self.stops, self.is_armed, self.lag_s = 0, True, 0.0
        self.decided_at, self.drives, self.problem = -1, 0, ""
        self.is_connected = asyncio.Event()
        self.is_connected.set()
        self._listeners: set[asyncio.Queue[Any]] = set()

    def tell(self) -> None:
        """Say how the gate stands; None: the connection is gone."""
        for queue in self._listeners:
            queue.put_nowait(self._safety() if self.is_connected.is_set() else None)

    def _safety(self) -> SafetyData:
        mode = "armed" if self.is_armed else "disarmed"
        return SafetyData(mode, "", None, self.is_armed, {}, stop_number=self.stops)

    def stop_now(self, *, is_armed: bool) -> None:
        """Somebody, or a fault, stops it."""
        self.stops, self.is_armed = self.stops + 1, is_armed
        self.tell()

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[Client]:
        """As a client does it."""
        await self.is_connected.wait()
        yield cast("Client", self)

    async def register_agent(self, name: str, version: str) -> None:
        """Nothing more is needed of it."""

    @asynccontextmanager
    async def subscribe(self, topics: list[str], policy: str) -> AsyncIterator[AsyncIterator[Any]]:
        """What the gate says, late where the line is slow."""
        queue: asyncio.Queue[Any] = asyncio.Queue()
        queue.put_nowait(self._safety())
        self._listeners.add(queue)

        async def events() -> AsyncIterator[Any]:
            while True:
                data = await queue.get()
                await asyncio.sleep(self.lag_s)
                if data is None:
                    raise ConnectionLost("it is gone")
                yield SimpleNamespace(data=data)

        try:
            yield events()
        finally:
            self._listeners.discard(queue)

    async def call(self, method: str) -> dict[str, int]:
        """The page's own stop."""
        assert method == "stop"
        await self._travel()
        self.stop_now(is_armed=self.is_armed)
        return {"stop_number": self.stops}

    async def _travel(self) -> None:
        await asyncio.sleep(self.lag_s)
        if not self.is_connected.is_set():
            raise ConnectionLost("it is gone")

    async def list_places(self) -> SimpleNamespace:
        """One table."""
        return SimpleNamespace(places=[SimpleNamespace(name="table 2", kind="table")])

    async def say(self, text: str) -> None:
        """Nobody listens."""

    async def navigate_to(self, if_stop_number: int | None = None, **goal: Any) -> None:
        """Drive, unless it was stopped since that number; a stop ends it, which nobody needs to see here."""
        await self._travel()
        if not self.is_armed or if_stop_number not in (None, self.stops):
            raise CallError("navigate_to", -32000, "it was stopped", {"kind": "stopped_since"})
        self.drives += 1
        if self.decided_at != self.stops:
            self.problem = "it drives for what was decided before a stop"
        await asyncio.sleep(DRIVES_S)


class Run:
    """One sequence: what two people with a page each, and others beside them, do."""

    def __init__(self, countdown_s: float | None) -> None:
        self.robot, self._ear, talkers = Robot(), SlowEar(), Talkers()
        self._ear.hears = Heard(SENTENCE, 1.0)
        self.agent = SpeechAgent(self.robot.connect, FakeSpeaker(), self._ear, talkers.end_countdowns)  # type: ignore[arg-type]
        self._has_countdown = countdown_s is not None
        self.pages = [
            PageTalker(self._show, self.agent, self._ear.recognize, talkers, countdown_s) for _ in range(2)
        ]

    async def _show(self, state: dict[str, Any]) -> None:
        pass

    async def do(self, deed: str) -> None:
        """One deed, and a moment for what follows."""
        robot, page = self.robot, self.pages[0]
        if deed.endswith("sentence"):
            page = self.pages[deed.startswith("other")]
            await self._press(page)
            await asyncio.sleep(0.5)
            await self._release(page)
        elif deed == "press":
            await self._press(page)
        elif deed == "release":
            await self._release(page)
        elif deed == "yes":
            robot.decided_at = robot.stops
            await page.take(YES)
        elif deed == "page's stop":
            await page.take({"event": "stop"})
        elif deed in ("stop of another", "fault"):
            robot.stop_now(is_armed=robot.is_armed and deed != "fault")
        elif deed == "arm":
            robot.is_armed = True
            robot.tell()
        elif deed == "away":
            robot.is_connected.clear()
            robot.tell()
        elif deed == "back":
            robot.is_connected.set()
        elif deed.endswith("line"):
            robot.lag_s = ON_ITS_WAY_S if deed == "slow line" else 0.0
        elif deed.endswith("ear"):
            self._ear.hears_for_s = HEARS_FOR_S if deed == "slow ear" else 0.0
        await asyncio.sleep({"wait": 1.0, "wait long": 5.0}.get(deed, 0.01))

    async def _press(self, page: PageTalker) -> None:
        await page.take(PRESS)
        page.add_sound(bytes(3200))

    async def _release(self, page: PageTalker) -> None:
        """Where a countdown follows, the sentence itself is the decision."""
        if page.is_listening and self._has_countdown:
            self.robot.decided_at = self.robot.stops
        await page.take(RELEASE)


async def one(choose: random.Random) -> int:
    """A random sequence; how often the robot has driven."""
    run = Run(COUNTDOWN_S if choose.random() < 0.5 else None)
    deeds = choose.choices(DEEDS, k=LENGTH)
    working = asyncio.create_task(run.agent.run())
    try:
        await asyncio.sleep(0.5)
        for page in run.pages:
            await page.begin()
        for count, deed in enumerate(deeds, 1):
            await run.do(deed)
            assert not run.robot.problem, f"{run.robot.problem}: {', '.join(deeds[:count])}"
    finally:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(working, *others, return_exceptions=True)
    return run.robot.drives


@pytest.mark.parametrize(
    "number", [100, pytest.param(int(os.environ.get("SEQUENCES", "10000")), marks=pytest.mark.slow)]
)
def test_no_sentence_from_before_a_stop_has_the_robot_drive(number: int) -> None:
    """Whoever waits for recognition, a yes, a countdown or the line; and a share of the sequences does drive."""
    assert sum(drives > 0 for drives in run_sequences(one, number, seed=37)) > number / 20
