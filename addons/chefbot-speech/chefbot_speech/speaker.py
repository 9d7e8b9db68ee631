"""Says sentences aloud, one after the other, with espeak-ng or flite. It never blocks, and never speaks of old things.

The newest sentence of each speaker replaces the one of it that still waits, and one that has waited too long is left
out. Where there is no program or no sound device, that is said once, and everything else goes on.
"""

import asyncio
import shutil
import signal
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import structlog

from chefbotd.child import send_signal

log = structlog.get_logger("speech")
STALE_S: Final = 8.0
MOST_WAITING: Final = 8
LONGEST_S: Final = 30.0
"""A program that takes longer for a sentence hangs, and is ended."""

PLAYERS: Final = (("paplay",), ("aplay", "-q"))


class Voice(Protocol):
    """Turns text into a WAV file, as a command that is run without a shell."""

    def command(self, text: str, wav: Path) -> Sequence[str]:
        """The program and its arguments."""
        ...


@dataclass(frozen=True, slots=True)
class Espeak:
    """espeak-ng, with a voice of ``espeak-ng --voices``, such as ``en``, ``de`` or ``en-us+f3``."""

    language: str = "en"

    def command(self, text: str, wav: Path) -> Sequence[str]:
        """The program and its arguments."""
        return ("espeak-ng", "-v", self.language, "-w", str(wav), "--", text)


@dataclass(frozen=True, slots=True)
class Flite:
    """flite, with a voice of ``flite -lv``; it speaks English only."""

    voice: str = "slt"

    def command(self, text: str, wav: Path) -> Sequence[str]:
        """The program and its arguments."""
        return ("flite", "-voice", self.voice, "-t", text, "-o", str(wav))


@dataclass(frozen=True, slots=True)
class Sentence:
    """``speaker`` says ``text``; it was new at ``stamp_s``."""

    speaker: str
    text: str
    stamp_s: float


def player() -> tuple[str, ...] | None:
    """The program that plays WAV files on this computer."""
    return next((words for words in PLAYERS if shutil.which(words[0])), None)


def add(waiting: Sequence[Sentence], sentence: Sentence) -> tuple[Sentence, ...]:
    """The queue with one more: the newest of each speaker counts, and the oldest are dropped when there are too many."""
    others = tuple(other for other in waiting if other.speaker != sentence.speaker)
    return (*others, sentence)[-MOST_WAITING:]


class Speaker:
    """``play`` is the command that plays a WAV file; None: nothing plays. ``heard`` is called with what was said."""

    def __init__(
        self, voice: Voice, play: Sequence[str] | None, heard: Callable[[str], None] = lambda text: None
    ) -> None:
        self._voice, self._play, self._heard = voice, play, heard
        self._waiting: tuple[Sentence, ...] = ()
        self._has_some = asyncio.Event()
        self._process: asyncio.subprocess.Process | None = None
        self._is_hushed = self._is_cut = False
        self.problem = ""

    def say(self, speaker: str, text: str) -> None:
        """It is said when those before it are."""
        self._waiting = add(self._waiting, Sentence(speaker, text, self._now_s()))
        self._has_some.set()

    def hush(self, *, is_hushed: bool) -> None:
        """Be silent from now on, because somebody talks into a microphone; or not any more.

        What waits, and what is being said, is not said later.
        """
        self._is_hushed = is_hushed
        if not is_hushed:
            self._has_some.set()
            return
        self._waiting, self._is_cut = (), True
        if self._process is not None:
            send_signal(self._process, signal.SIGKILL)

    async def run(self) -> None:
        """Speak until cancelled."""
        with tempfile.TemporaryDirectory(prefix="chefbot-speech-") as folder:
            while True:
                await self._has_some.wait()
                if self._is_hushed or not self._waiting:
                    self._has_some.clear()
                    continue
                sentence, *rest = self._waiting
                self._waiting, self._is_cut = tuple(rest), False
                if self._now_s() - sentence.stamp_s <= STALE_S:
                    await self._speak(sentence.text, Path(folder) / "sentence.wav")

    async def _speak(self, text: str, wav: Path) -> None:
        made = await self._run(self._voice.command(text, wav), "no voice", "apt-get install espeak-ng")
        if not made or self._is_cut:
            return
        if self._play is None:
            self._has_problem("no sound", "there is no program that plays it: apt-get install alsa-utils")
        elif made and await self._run(
            (*(self._play or ()), str(wav)), "no sound", "is a sound device there?"
        ):
            self.problem = ""
            self._heard(text)

    async def _run(self, command: Sequence[str], problem: str, hint: str) -> bool:
        """Whether the program did it. One that is hushed has not failed."""
        try:
            self._process = await asyncio.create_subprocess_exec(
                *command, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE
            )
            if self._is_cut:  # while it was being started
                send_signal(self._process, signal.SIGKILL)
            async with asyncio.timeout(LONGEST_S):
                _, errors = await self._process.communicate()
        except FileNotFoundError:
            return self._has_problem(problem, f"{command[0]} is not installed: {hint}")
        except TimeoutError:
            return self._has_problem(problem, f"{command[0]} hangs")
        finally:
            process, self._process = self._process, None
            if process is not None:
                send_signal(process, signal.SIGKILL)
                await process.wait()
        code = process.returncode if process is not None else None
        if code is not None and code > 0:
            words = errors.decode(errors="replace").strip().splitlines()
            return self._has_problem(problem, f"{words[-1] if words else command[0]} ({hint})")
        return code == 0

    def _has_problem(self, problem: str, why: str) -> bool:
        if problem != self.problem:
            log.warning(problem.replace(" ", "_"), why=why)
        self.problem = problem
        return False

    @staticmethod
    def _now_s() -> float:
        return asyncio.get_running_loop().time()
