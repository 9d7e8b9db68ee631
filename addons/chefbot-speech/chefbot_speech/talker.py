"""One page with the button to talk: carries out the steps of its dialogue.

A yes confirms only what the same page has proposed.
"""

import asyncio
from typing import Any, Final, Protocol

import structlog

from chefbot_speech import dialogue
from chefbot_speech.commands import Action, Command, Vocabulary
from chefbot_speech.dialogue import Dialogue, Phase, Step
from chefbot_speech.listening import Listening, Recognize
from chefbot_speech.server import Send

log = structlog.get_logger("speech")
LOOK_S: Final = 0.1
RATES_HZ: Final = (8_000, 192_000)
ANSWERS: Final = {"yes": Action.YES, "no": Action.NO}


class Robot(Protocol):
    """What a talker needs of the robot."""

    async def stop(self) -> str:
        """Brake. Empty, or why it cannot be said that the robot brakes, for people."""
        ...

    def go(self, place: str) -> None:
        """Begin to go to a place; whatever becomes of it is said."""
        ...

    def say(self, text: str) -> None:
        """Say it aloud, and on the robot's page."""
        ...

    def hush(self, *, is_hushed: bool) -> None:
        """Be silent from now on, or not any more."""
        ...

    async def vocabulary(self) -> Vocabulary:
        """The places as they are now."""
        ...


class Talkers:
    """All pages of a robot: while somebody talks on one of them, nothing begins on any."""

    def __init__(self) -> None:
        self._pages: set[PageTalker] = set()

    def add(self, page: "PageTalker") -> None:
        """A page is there."""
        self._pages.add(page)

    def discard(self, page: "PageTalker") -> None:
        """It is gone."""
        self._pages.discard(page)

    def others_talk(self, page: "PageTalker") -> bool:
        """Whether somebody talks on another page, or what was said there is still being recognized."""
        return any(other.is_talking for other in self._pages - {page})

    def is_listening(self) -> bool:
        """Whether a microphone is open."""
        return any(page.is_listening for page in self._pages)

    def end_countdowns(self) -> None:
        """Somebody talks, or the robot was stopped: nothing begins by itself."""
        for page in self._pages:
            page.end_countdown()


class PageTalker:
    """``send`` shows the dialogue on the page. ``countdown_s``: when a goal begins by itself; None: after a yes only."""

    def __init__(
        self,
        send: Send,
        robot: Robot,
        recognize: Recognize,
        talkers: Talkers,
        countdown_s: float | None = None,
    ) -> None:
        self._send, self._robot, self._recognize, self._countdown_s = send, robot, recognize, countdown_s
        self._talkers = talkers
        self._dialogue, self._text = Dialogue(), ""
        self._was_stopped = False  # since talk was pressed, by somebody else
        self._listening = Listening(recognize)
        self._places: asyncio.Task[Vocabulary] | None = None
        self._hearing: asyncio.Task[None] | None = None
        self._looking: asyncio.Task[None] | None = None
        self._showing: asyncio.Task[None] | None = None

    @property
    def is_talking(self) -> bool:
        """Whether somebody talks, or what was said is being recognized."""
        return self._dialogue.phase is not Phase.READY

    @property
    def is_listening(self) -> bool:
        """Whether its microphone is open."""
        return self._dialogue.phase is Phase.LISTENING

    async def begin(self) -> None:
        """Show what can be said."""
        self._talkers.add(self)
        await self._show(await self._robot.vocabulary())

    def add_sound(self, data: bytes) -> None:
        """A piece of what is said: 16 bits a sample, little-endian, one channel."""
        if self.is_listening:
            self._listening.add(data, self._grammar())

    def _grammar(self) -> str | None:
        """What can be said now; None: the places are not known yet."""
        places = self._places
        if places is None or not places.done() or places.cancelled() or places.exception() is not None:
            return None
        return places.result().grammar(confirming=bool(self._dialogue.proposal))

    async def take(self, message: dict[str, Any]) -> None:
        """Something was pressed, released or touched."""
        loop = asyncio.get_running_loop()
        match message:
            case {"event": "press", "rate_hz": int(rate_hz)} if RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
                await self._press(rate_hz)
            case {"event": "release"} if self.is_listening:
                await self._do(dialogue.release(self._dialogue))
                self._robot.hush(is_hushed=self._talkers.is_listening())
                self._hearing = asyncio.create_task(self._hear())
            case {"event": "stop"}:
                await self._stop()
            case {"event": "lost"} if self.is_listening:
                await self._lose_microphone()
            case {"event": "touch"}:
                await self._do(dialogue.touch(self._dialogue))
            case {"event": "answer", "choice": str(choice)} if choice in ANSWERS:
                await self._do(dialogue.answer(self._dialogue, ANSWERS[choice], loop.time()))

    async def _stop(self) -> None:
        """The robot first; then nothing begins by itself any more, and what was proposed is forgotten."""
        problem = await self._robot.stop()
        self._talkers.end_countdowns()
        step = dialogue.answer(self._dialogue, Action.STOP, asyncio.get_running_loop().time())
        self._dialogue, self._text = step.dialogue, problem or step.text
        self._look_again()
        await self._show(stopped=not problem)

    async def leave(self) -> None:
        """The page is gone, and what it proposed with it."""
        self._talkers.discard(self)
        self._robot.hush(is_hushed=self._talkers.is_listening())
        self._listening.cancel()
        own = (self._places, self._hearing, self._looking, self._showing)
        tasks = [task for task in own if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _press(self, rate_hz: int) -> None:
        """The stop is asked for before anything else is done that takes time."""
        self._talkers.end_countdowns()
        if self._hearing is not None:
            self._hearing.cancel()
        self._robot.hush(is_hushed=True)
        self._was_stopped = False
        await self._do(dialogue.press(self._dialogue))
        self._listening.cancel()
        self._listening = Listening(self._recognize, rate_hz)
        self._places = asyncio.create_task(self._robot.vocabulary())

    async def _lose_microphone(self) -> None:
        """What was broken off is not understood: nobody said the end of it."""
        self._listening.cancel()
        await self._do(dialogue.release(self._dialogue))
        self._robot.hush(is_hushed=self._talkers.is_listening())
        now_s = asyncio.get_running_loop().time()
        await self._do(dialogue.hear(self._dialogue, None, now_s, self._countdown_s))

    async def _hear(self) -> None:
        """What was said, or None where that is not certain."""
        command: Command | None = None
        if self._places is not None and not self._listening.is_too_long:
            vocabulary = await self._places
            confirming = bool(self._dialogue.proposal)
            heard = await self._listening.heard(vocabulary.grammar(confirming=confirming))
            command = vocabulary.understood(heard)
            log.info("heard", text=heard.text, margin=round(heard.margin, 2), understood=command is not None)
        now_s = asyncio.get_running_loop().time()
        countdown_s = None if self._was_stopped else self._countdown_s
        await self._do(dialogue.hear(self._dialogue, command, now_s, countdown_s))

    def end_countdown(self) -> None:
        """Somebody talks on another page, or the robot was stopped: what is being said needs a yes, too."""
        self._was_stopped = True
        step = dialogue.interrupt(self._dialogue)
        if step.dialogue != self._dialogue:
            self._dialogue, self._text = step.dialogue, step.text
            self._look_again()
            self._showing = asyncio.create_task(self._show())

    async def _do(self, step: Step) -> None:
        """The robot first, then people."""
        if step.effect is dialogue.Effect.GO and self._talkers.others_talk(self):
            step = dialogue.postpone(self._dialogue)
        self._dialogue = step.dialogue
        problem = ""
        if step.effect is dialogue.Effect.STOP:
            problem = await self._robot.stop()
        elif step.effect is dialogue.Effect.GO:
            self._robot.go(step.place)
        self._text = problem or step.text
        if step.text:
            self._robot.say(step.text)
        self._look_again()
        await self._show()

    def _look_again(self) -> None:
        if self._looking is not None and self._looking is not asyncio.current_task():
            self._looking.cancel()
        self._looking = asyncio.create_task(self._look()) if self._dialogue.proposal else None

    async def _look(self) -> None:
        """A timer may fire a little early: then it is set again."""
        loop, now = asyncio.get_running_loop(), self._dialogue
        end_s = min(end_s for end_s in (now.forget_s, now.start_s) if end_s is not None)
        step = dialogue.look(now, loop.time())
        while step.dialogue == now:
            await asyncio.sleep(max(LOOK_S, end_s - loop.time()))
            step = dialogue.look(now, loop.time())
        await self._do(step)

    async def _show(self, vocabulary: Vocabulary | None = None, *, stopped: bool | None = None) -> None:
        shown: dict[str, Any] = {
            "phase": self._dialogue.phase,
            "text": self._text,
            "proposal": self._dialogue.proposal,
        }
        if stopped is not None:
            shown["stopped"] = stopped
        if vocabulary is not None:
            shown |= {"places": sorted(set(vocabulary.goals.values())), "left_out": vocabulary.left_out}
        await self._send(shown)
