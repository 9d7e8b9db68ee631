"""What is said aloud; espeak-ng is the real one, and what plays is a program that copies the file."""

import asyncio
import shutil
import wave
from pathlib import Path

import pytest
from chefbot_speech.speaker import MOST_WAITING, Espeak, Flite, Sentence, Speaker, add
from structlog.testing import capture_logs


async def spoken(speaker: Speaker, *texts: str, heard: list[str], count: int) -> None:
    """Say these, each as a speaker of its own, until so many have been heard."""
    task = asyncio.create_task(speaker.run())
    for number, text in enumerate(texts):
        speaker.say(f"agent {number}", text)
    async with asyncio.timeout(100.0):
        while len(heard) < count:  # noqa: ASYNC110 - the programs are real
            await asyncio.sleep(0.01)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@pytest.mark.parametrize("voice", [Espeak("en"), Espeak("de"), Flite()])
def test_a_sentence_becomes_sound(espeak: str, tmp_path: Path, voice: Espeak | Flite) -> None:
    """A WAV file of at least half a second that is not silent; a text may look like an option."""
    if isinstance(voice, Flite) and shutil.which("flite") is None:
        pytest.skip("flite is not installed: make addons-tools")
    heard: list[str] = []
    copy = ("cp", "-t", str(tmp_path))
    asyncio.run(spoken(Speaker(voice, copy, heard.append), "-v I am coming to table 3", heard=heard, count=1))
    with wave.open(str(tmp_path / "sentence.wav")) as sound:
        assert sound.getnframes() > 0.5 * sound.getframerate()
        assert any(sound.readframes(sound.getnframes()))
    assert heard == ["-v I am coming to table 3"]


def test_sentences_are_said_in_turn(espeak: str) -> None:
    """Of three speakers, one each."""
    heard: list[str] = []
    asyncio.run(
        spoken(Speaker(Espeak(), ("true",), heard.append), "one", "two", "three", heard=heard, count=3)
    )
    assert heard == ["one", "two", "three"]


def test_the_newest_sentence_of_a_speaker_replaces_the_one_that_waits() -> None:
    """Others keep theirs, and the queue is bounded."""
    waiting = (Sentence("waiter", "I am coming", 1.0), Sentence("speech", "I stand", 2.0))
    now = add(waiting, Sentence("waiter", "I have to wait", 3.0))
    assert [sentence.text for sentence in now] == ["I stand", "I have to wait"]
    for number in range(20):
        now = add(now, Sentence(str(number), "hello", 4.0))
    assert [sentence.speaker for sentence in now] == [str(number) for number in range(20 - MOST_WAITING, 20)]


def test_without_a_sound_device_it_is_said_once(espeak: str) -> None:
    """And the next sentence is tried all the same."""
    heard: list[str] = []

    async def run() -> None:
        speaker = Speaker(Espeak(), ("sh", "-c", "echo no such device >&2; exit 1"), heard.append)
        task = asyncio.create_task(speaker.run())
        for text in ("one", "two", "three"):
            speaker.say(text, text)
        async with asyncio.timeout(100.0):
            while speaker._waiting or speaker._process is not None:  # noqa: ASYNC110 - the programs are real
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    with capture_logs() as logs:
        asyncio.run(run())
    assert heard == []
    assert [(line["event"], line["why"]) for line in logs] == [
        ("no_sound", "no such device (is a sound device there?)")
    ]


def test_a_program_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With what to install; nothing else fails."""
    monkeypatch.setenv("PATH", str(tmp_path))

    async def run() -> str:
        speaker = Speaker(Espeak(), ("true",))
        task = asyncio.create_task(speaker.run())
        speaker.say("waiter", "hello")
        async with asyncio.timeout(100.0):
            while not speaker.problem:  # noqa: ASYNC110 - the program is looked for by the system
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return speaker.problem

    with capture_logs() as logs:
        assert asyncio.run(run()) == "no voice"
    assert "apt-get install espeak-ng" in logs[0]["why"]


def test_hushed_it_says_nothing_that_waits(espeak: str) -> None:
    """What is being played ends at once, without being a problem, and the next sentence is said."""
    heard: list[str] = []

    async def run() -> Speaker:
        speaker = Speaker(Espeak(), ("tail", "-f"), heard.append)
        task = asyncio.create_task(speaker.run())
        speaker.say("waiter", "a long story")
        speaker.say("other", "another")
        async with asyncio.timeout(100.0):
            while speaker._process is None:  # noqa: ASYNC110 - the program is real
                await asyncio.sleep(0.01)
            speaker.hush(is_hushed=True)
            while speaker._process is not None:  # noqa: ASYNC110 - the program is real
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return speaker

    with capture_logs() as logs:
        assert asyncio.run(run()).problem == ""
    assert (heard, logs) == ([], [])


class FakeVoice:
    """``true`` makes no sound at once, and ``sleep`` stands for a text that is begun and never ends."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def command(self, text: str, wav: Path) -> tuple[str, ...]:
        """The program and its arguments."""
        self.texts.append(text)
        return ("sleep", "600") if text == "endless" else ("true",)


async def steps() -> None:
    """Let everything that can run begin; no program can have ended or said anything."""
    for _ in range(5):
        await asyncio.sleep(0)


def test_nothing_new_is_said_while_it_is_hushed() -> None:
    """What agents say meanwhile is said when the microphone is closed."""
    heard: list[str] = []

    async def run() -> None:
        voice = FakeVoice()
        speaker = Speaker(voice, ("true",), heard.append)
        task = asyncio.create_task(speaker.run())
        speaker.hush(is_hushed=True)
        speaker.say("waiter", "I am coming")
        await steps()
        assert voice.texts == []
        speaker.hush(is_hushed=False)
        async with asyncio.timeout(100.0):
            while not heard:  # noqa: ASYNC110 - the programs are real
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(run())
    assert heard == ["I am coming"]


def test_a_program_that_is_being_started_when_it_is_hushed_is_ended() -> None:
    """And is no problem; what is said afterwards is heard."""
    heard: list[str] = []

    async def run() -> None:
        voice = FakeVoice()
        speaker = Speaker(voice, ("true",), heard.append)
        task = asyncio.create_task(speaker.run())
        speaker.say("waiter", "endless")
        while not voice.texts:  # noqa: ASYNC110 - the program is being started then
            await asyncio.sleep(0)
        assert speaker._process is None
        speaker.hush(is_hushed=True)
        speaker.hush(is_hushed=False)
        async with asyncio.timeout(100.0):
            while not heard:
                speaker.say("waiter", "next")
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    with capture_logs() as logs:
        asyncio.run(run())
    assert (set(heard), logs) == ({"next"}, [])
