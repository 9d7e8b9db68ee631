"""What is said while the button is held, and its recognition, which begins with a pause.

Most of what the recognizer does is done by the time that the button is released. Where somebody goes on after the pause,
it is thrown away, and all that was said is recognized again.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from chefbot_speech.recognition import RATE_HZ, Heard, Samples, resampled
from chefbot_speech.sound import speech_end

LONGEST_S: Final = 8.0
"""What is said after this time is not listened to, and then nothing of it counts."""

PAUSE_S: Final = 0.1
"""The stop before a consonant is shorter, as a rule."""

Recognize = Callable[[Samples, str], Awaitable[Heard]]


@dataclass(frozen=True, slots=True)
class _Attempt:
    """The recognition of the first so many samples, with a grammar."""

    count: int
    grammar: str
    heard: asyncio.Task[Heard]


class Listening:
    """The sound of one press. Nothing is recognized in a pause before there is a grammar."""

    def __init__(self, recognize: Recognize, rate_hz: int = RATE_HZ) -> None:
        self._recognize, self._rate_hz = recognize, rate_hz
        self._sound = bytearray()
        self._attempt: _Attempt | None = None

    @property
    def is_too_long(self) -> bool:
        """Whether more was said than is listened to."""
        return len(self._sound) > int(2 * LONGEST_S * self._rate_hz)

    def add(self, data: bytes, grammar: str | None) -> None:
        """A piece of what is said: 16 bits a sample, little-endian, one channel."""
        if self.is_too_long:
            return
        self._sound += data
        if grammar is None or (self._attempt is not None and not self._attempt.heard.done()):
            return
        samples = self._samples()
        end = speech_end(samples, self._rate_hz)
        pauses = 0 < end <= len(samples) - PAUSE_S * self._rate_hz
        if pauses and not self._is_covered(end, grammar):
            heard = asyncio.ensure_future(self._recognized(samples, grammar))
            self._attempt = _Attempt(len(samples), grammar, heard)

    async def heard(self, grammar: str) -> Heard:
        """What was said."""
        samples = self._samples()
        if self._attempt is not None and self._is_covered(speech_end(samples, self._rate_hz), grammar):
            return await self._attempt.heard
        self.cancel()
        return await self._recognized(samples, grammar)

    def cancel(self) -> None:
        """Nobody wants to know any more."""
        if self._attempt is not None:
            self._attempt.heard.cancel()

    def _is_covered(self, end: int, grammar: str) -> bool:
        """Whether all that was said, up to ``end``, was before the pause."""
        attempt = self._attempt
        return attempt is not None and end <= attempt.count and grammar == attempt.grammar

    def _samples(self) -> Samples:
        return np.frombuffer(bytes(self._sound[: len(self._sound) // 2 * 2]), dtype="<i2")

    async def _recognized(self, samples: Samples, grammar: str) -> Heard:
        return await self._recognize(resampled(samples, self._rate_hz), grammar)
