"""pocketsphinx with the voice of espeak-ng, and the child process that a recognizer runs in."""

import asyncio
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from chefbot_speech.commands import Action, Command, Vocabulary
from chefbot_speech.ear import Ear
from chefbot_speech.recognition import RATE_HZ, Heard, Samples, resampled
from chefbot_speech.sound import prepared
from chefbot_speech.sphinx import PocketSphinx, Word, compare
from speech_voices import said

from chefbotd.client.models import PlaceData

VOCABULARY = Vocabulary.of(
    [PlaceData(f"table {number}", 0.0, 0.0, 0.0, "table") for number in range(1, 6)]  # type: ignore[arg-type]
)
GRAMMAR = VOCABULARY.grammar(confirming=True)


@pytest.fixture(scope="module")
def recognizer() -> PocketSphinx:
    """One for all: its model takes a while to load."""
    return PocketSphinx()


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("go to table three", Command(Action.GO, "table 3")),
        ("please drive to table five", Command(Action.GO, "table 5")),
        ("cancel please", Command(Action.CANCEL)),
        ("yes please", Command(Action.YES)),
        ("what do you recommend", None),
        ("the train to London was late again", None),
    ],
)
def test_a_phrase_is_told_from_other_speech(
    espeak: str, tmp_path: Path, recognizer: PocketSphinx, text: str, command: Command | None
) -> None:
    """With the words of the grammar, or as nothing."""
    heard = recognizer.recognize(said(espeak, tmp_path, text), GRAMMAR)
    assert VOCABULARY.understood(heard) == command, heard


@pytest.mark.parametrize(
    "sound", [np.zeros(0), np.zeros(16_000), np.random.default_rng(3).normal(0, 500, 32_000)]
)
def test_silence_and_noise_are_nothing(
    recognizer: PocketSphinx, sound: "np.typing.NDArray[np.float64]"
) -> None:
    """Also digital silence, and no sound at all."""
    heard = recognizer.recognize(sound.astype(np.int16), GRAMMAR)
    assert VOCABULARY.understood(heard) is None


def test_words_that_the_dictionary_lacks_are_told(recognizer: PocketSphinx) -> None:
    """So their places can be named."""
    assert recognizer.words(frozenset({"table", "kitchen", "plötzensee"})) == {"table", "kitchen"}


def test_how_far_a_phrase_is_behind_is_taken_word_by_word() -> None:
    """Phones: -1 in each of 20 frames; words: -2 a frame in the first ten, -5 in the others."""
    phones = [Word("A", 0, 9, -10.0), Word("B", 10, 19, -10.0)]
    fit = compare([Word("go", 0, 9, -20.0), Word("home", 10, 19, -50.0)], phones)
    assert fit is not None
    assert (fit.mean, fit.worst) == (2.5, 4.0)
    assert compare([Word("go", 0, 9, -20.0)], []) is None


@pytest.mark.parametrize("rate_hz", [8_000, 44_100, 48_000])
def test_sound_at_another_rate_keeps_its_tone(rate_hz: int) -> None:
    """1 kHz for a second stays 1 kHz, to 2 % of its amplitude."""
    times = np.arange(rate_hz) / rate_hz
    new = resampled((10_000 * np.sin(2000 * np.pi * times)).astype(np.int16), rate_hz)
    middle = slice(1000, 15_000)
    expected = 10_000 * np.sin(2000 * np.pi * np.arange(RATE_HZ) / RATE_HZ)
    assert len(new) == RATE_HZ
    assert np.abs(new[middle] - expected[middle]).max() < (200 if rate_hz > RATE_HZ else 800)


def test_a_tone_beyond_the_new_rate_is_gone() -> None:
    """12 kHz, of 48 kHz, would be heard as 4 kHz."""
    times = np.arange(48_000) / 48_000
    new = resampled((10_000 * np.sin(24_000 * np.pi * times)).astype(np.int16), 48_000)
    assert np.abs(new[1000:15_000]).max() < 100


def test_speech_is_cut_out_of_silence() -> None:
    """A second of a tone in three seconds: with 0.15 s before and after it."""
    sound = np.random.default_rng(1).normal(0.0, 5.0, 3 * RATE_HZ)
    times = np.arange(RATE_HZ) / RATE_HZ
    sound[RATE_HZ : 2 * RATE_HZ] += 5_000 * np.sin(880 * np.pi * times)
    assert len(prepared(sound.astype(np.int16))) == pytest.approx(1.3 * RATE_HZ, rel=0.05)


class Failing:
    """A recognizer that ends its process."""

    def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """All."""
        return candidates

    def recognize(self, samples: Samples, grammar: str) -> Heard:
        """End."""
        if len(samples) == 0:
            os._exit(3)
        return Heard(grammar, 1.0)


def test_a_recognizer_whose_process_ends_has_heard_nothing_and_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The next phrase is recognized; it is any class that is named."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))

    async def run() -> tuple[Heard, Heard, frozenset[str]]:
        ear = Ear("test_speech_recognition:Failing")
        try:
            first = await ear.recognize(np.zeros(0, np.int16), "a")
            return first, await ear.recognize(np.zeros(1, np.int16), "b"), await ear.words(frozenset({"c"}))
        finally:
            ear.close()

    nothing, heard, words = asyncio.run(run())
    assert not nothing.is_certain
    assert (heard, words) == (Heard("b", 1.0), {"c"})


KILLED = """
import asyncio, os, signal
from chefbot_speech.ear import Ear

async def run():
    ear = Ear("test_speech_recognition:Failing")
    await ear.words(frozenset())
    print(*ear._process._processes, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    asyncio.run(run())
"""


def test_a_program_that_is_killed_leaves_no_recognizer_behind(tmp_path: Path) -> None:
    """Its process ends with it."""
    (tmp_path / "killed.py").write_text(KILLED)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "killed.py")], env=environment, stdout=subprocess.PIPE, text=True
    )
    process = Path(f"/proc/{int(ended.stdout)}")
    end_s = time.monotonic() + 30.0
    while process.exists() and "Z (zombie)" not in (process / "status").read_text():
        assert time.monotonic() < end_s
        time.sleep(0.02)
