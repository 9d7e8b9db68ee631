"""What is recognized before the button is released, and what of it counts. Sound is a tone, a pause is quiet noise."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np
import pytest
from chefbot_speech.listening import Listening
from chefbot_speech.recognition import Heard, Samples
from chefbot_speech.sound import speech_end

RATE_HZ = 16_000


def quiet(duration_s: float, level: float = 5.0) -> Samples:
    """Nobody speaks; the same in every call."""
    noise = np.random.default_rng(1).normal(0.0, level, int(duration_s * RATE_HZ))
    return noise.astype(np.int16)


def speech(duration_s: float) -> Samples:
    """A tone of 200 Hz."""
    times = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    return (5_000.0 * np.sin(2 * np.pi * 200 * times)).astype(np.int16)


class FakeRecognizer:
    """Hears how many samples it gets, once it may answer."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, str]] = []
        self.may_answer = asyncio.Event()

    async def recognize(self, samples: Samples, grammar: str) -> Heard:
        """The number of samples as text."""
        self.asked.append((len(samples), grammar))
        await self.may_answer.wait()
        return Heard(str(len(samples)), 1.0)


def listening(scenario: Callable[[Listening, FakeRecognizer], Awaitable[None]]) -> None:
    """Run a scenario: quiet for 0.4 s, speech for 0.8 s and a pause of 0.2 s are there, and being recognized."""

    async def run() -> None:
        recognizer = FakeRecognizer()
        page = Listening(recognizer.recognize, RATE_HZ)
        for piece in (quiet(0.4), speech(0.8)):
            page.add(piece.tobytes(), "words")
            await asyncio.sleep(0)
            assert recognizer.asked == []
        page.add(quiet(0.2).tobytes(), "words")
        await asyncio.sleep(0)
        assert recognizer.asked == [(22_400, "words")]
        await scenario(page, recognizer)

    asyncio.run(run())


def test_what_was_recognized_in_the_last_pause_counts() -> None:
    """More of the pause changes nothing: 22400 samples were there when it began."""

    async def scenario(page: Listening, recognizer: FakeRecognizer) -> None:
        page.add(quiet(0.3).tobytes(), "words")
        recognizer.may_answer.set()
        assert await page.heard("words") == Heard("22400", 1.0)
        assert len(recognizer.asked) == 1

    listening(scenario)


def test_who_goes_on_after_a_pause_is_heard_whole() -> None:
    """Although the button is released before there is another pause: 22400 samples and 16000."""

    async def scenario(page: Listening, recognizer: FakeRecognizer) -> None:
        recognizer.may_answer.set()
        page.add(speech(1.0).tobytes(), "words")
        assert await page.heard("words") == Heard("38400", 1.0)

    listening(scenario)


def test_one_pause_is_recognized_at_a_time() -> None:
    """The second pause waits until the recognizer has done with the first; then its result counts."""

    async def scenario(page: Listening, recognizer: FakeRecognizer) -> None:
        page.add(speech(0.5).tobytes(), "words")
        page.add(quiet(0.2).tobytes(), "words")
        await asyncio.sleep(0)
        assert len(recognizer.asked) == 1
        recognizer.may_answer.set()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        page.add(quiet(0.1).tobytes(), "words")
        assert await page.heard("words") == Heard("35200", 1.0)
        assert [count for count, _ in recognizer.asked] == [22_400, 35_200]

    listening(scenario)


def test_with_other_words_it_is_recognized_again() -> None:
    """What was proposed may be forgotten between the pause and the release: then a yes is no word."""

    async def scenario(page: Listening, recognizer: FakeRecognizer) -> None:
        recognizer.may_answer.set()
        assert await page.heard("other words") == Heard("22400", 1.0)
        assert [grammar for _, grammar in recognizer.asked] == ["words", "other words"]

    listening(scenario)


def test_before_there_are_words_nothing_is_recognized() -> None:
    """The places come from the daemon; what was said meanwhile is heard at the end."""

    async def run() -> None:
        recognizer = FakeRecognizer()
        recognizer.may_answer.set()
        page = Listening(recognizer.recognize, RATE_HZ)
        for piece in (quiet(0.4), speech(0.8), quiet(0.2)):
            page.add(piece.tobytes(), None)
        await asyncio.sleep(0)
        assert recognizer.asked == []
        assert await page.heard("words") == Heard("22400", 1.0)

    asyncio.run(run())


@pytest.mark.parametrize(
    ("sound", "end_s"),
    [
        (np.concatenate([quiet(0.5), speech(1.0), quiet(0.5)]), 1.5),
        (np.concatenate([quiet(0.5, 150.0), speech(1.0), quiet(0.5, 150.0)]), 1.5),
        (np.concatenate([quiet(0.5), speech(0.5), quiet(0.1), speech(0.5)]), 1.6),
        (quiet(2.0, 300.0), 0.0),
        (np.zeros(0, np.int16), 0.0),
        (np.zeros(RATE_HZ, np.int16), 0.0),
    ],
)
@pytest.mark.parametrize("step", [1, 2])
def test_speech_ends_with_its_last_loud_sound(sound: Samples, end_s: float, step: int) -> None:
    """To a window of 25 ms, at 16 and at 8 kHz, also in noise (here 27 dB below the tone); noise alone is no speech."""
    rate_hz = RATE_HZ // step
    assert abs(speech_end(sound[::step], rate_hz) / rate_hz - end_s) <= 0.025
