"""Whisper's parts beside known values, what is accepted, and the whole with the voice of espeak-ng."""

import math
from pathlib import Path

import numpy as np
import pytest
from chefbot_speech import whisper
from chefbot_speech.commands import Action, Command, Vocabulary
from chefbot_speech.ear import SPHINX, WHISPER, best_recognizer
from chefbot_speech.mel import filters, log_mel
from chefbot_speech.recognition import RATE_HZ
from chefbot_speech.tokens import Tokenizer, written
from speech_voices import said

from chefbotd.client.models import PlaceData

Scored = whisper.Scored
VOCABULARY = Vocabulary.of(
    [PlaceData(f"table {number}", 0.0, 0.0, 0.0, "table") for number in range(1, 6)]  # type: ignore[arg-type]
)


@pytest.fixture(scope="module")
def tokenizer() -> Tokenizer:
    """The one beside the model."""
    return Tokenizer(Path(whisper.get_model_path()) / "tokenizer.json")


@pytest.fixture(scope="module")
def recognizer() -> whisper.Whisper:
    """One for all: its model takes a while to load."""
    return whisper.Whisper()


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        (" Go to table three.", [1514, 284, 3084, 1115, 13]),
        (" hello world", [23748, 995]),
        ("Hello, world", [15496, 11, 995]),
    ],
)
def test_tokens_are_those_of_gpt_2(tokenizer: Tokenizer, text: str, numbers: list[int]) -> None:
    """As published for GPT-2's vocabulary; and back."""
    assert tokenizer.encode(text) == numbers
    assert tokenizer.decode(numbers) == text


def test_any_text_comes_back(tokenizer: Tokenizer) -> None:
    """Letters that the vocabulary lacks are bytes; what is no text is left out."""
    text = " Plötzensee 42, naïve ☃?"
    assert tokenizer.decode([*tokenizer.encode(text), whisper.END, whisper.START]) == text


@pytest.mark.parametrize(
    ("phrase", "text"),
    [
        ("go to table three", " Go to table 3."),
        ("go to table twenty one please", " Go to table 21 please."),
        ("stop", " Stop."),
        ("go to room fourteen", " Go to room 14."),
    ],
)
def test_a_phrase_is_written_with_digits(phrase: str, text: str) -> None:
    """As Whisper does it."""
    assert written(phrase) == text


def test_a_tone_is_in_its_band() -> None:
    """1 kHz is 15 on Slaney's scale, of 45.245 at 8 kHz: of 80 bands the one whose middle is nearest to 15."""
    top_mel = 15.0 + 27.0 * math.log(8.0) / math.log(6.4)
    nearest = round(15.0 / (top_mel / 81.0)) - 1
    times = np.arange(RATE_HZ) / RATE_HZ
    spectrogram = log_mel((8000 * np.sin(2000 * np.pi * times)).astype(np.int16), 2.0)
    assert spectrogram.shape == (80, 200)
    assert set(spectrogram[:, 10:90].argmax(axis=0)) == {nearest}
    assert spectrogram[:, 110:].max() == spectrogram.min()  # silence behind it


def test_each_band_has_the_same_area() -> None:
    """A triangle of area 1 over frequencies; steps of 40 Hz sample the narrow ones coarsely."""
    areas = filters().sum(axis=1) * 40.0
    assert areas[41:] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("likeliest", "phrase", "margin"),
    [
        (Scored("stop", -1.0), Scored("stop", -1.0), 3.0),  # MOST_BEHIND 3, nothing behind
        (Scored("Go home", -1.0), Scored("stop", -2.5), 1.5),
        (Scored("the soup", -1.0), Scored("stop", -4.5), -0.5),
        (Scored("stop", -7.0), Scored("stop", -7.0), -2.0),  # LEAST_LIKELIHOOD -5
        (Scored("", -3.0), Scored("stop", -4.0), 1.0),
    ],
)
def test_a_phrase_is_likely_and_nearly_the_likeliest_text(
    likeliest: whisper.Scored, phrase: whisper.Scored, margin: float
) -> None:
    """Within both limits the margin is at least 0."""
    assert whisper.margin(likeliest, phrase) == pytest.approx(margin)


@pytest.mark.parametrize(
    ("scores", "is_clear"), [([-1.0], True), ([-1.0, -3.0], True), ([-1.0, -2.9], False)]
)
def test_a_phrase_is_clear_that_is_far_ahead(scores: list[float], is_clear: bool) -> None:
    """By 2 in the logarithm."""
    assert whisper.is_clear([Scored(str(score), score) for score in scores]) is is_clear


def test_what_is_not_clear_is_looked_at_again_and_what_else_is_found_is_a_rival(
    monkeypatch: pytest.MonkeyPatch, recognizer: whisper.Whisper
) -> None:
    """Table four, then five when slower, then four: the five is a rival, so nothing is understood."""
    views = iter(
        [
            [Scored("go to table four", -1.0), Scored("go to table five", -1.5)],
            [Scored("go to table five", -1.0)],
            [Scored("go to table four", -1.0)],
        ]
    )
    monkeypatch.setattr(recognizer, "_phrases", lambda encoded, seconds: next(views))
    sound = np.random.default_rng(1).normal(0, 20, 32_000)
    sound[8_000:24_000] += 5_000 * np.sin(np.arange(16_000) / 5)
    found = recognizer.recognize(sound.astype(np.int16), VOCABULARY.grammar(confirming=False))
    assert (found.text, found.rivals) == ("go to table four", ("go to table five", "go to table four"))
    assert VOCABULARY.understood(found) is None


def test_a_slower_voice_is_lower() -> None:
    """A tone of 1 kHz over a second becomes one of 880 Hz that lasts 1/0.88 s."""
    times = np.arange(RATE_HZ) / RATE_HZ
    new = whisper.slower((8_000 * np.sin(2_000 * np.pi * times)).astype(np.int16))
    assert len(new) == pytest.approx(RATE_HZ / 0.88, abs=2)
    spectrum = np.abs(np.fft.rfft(new[:RATE_HZ]))
    assert spectrum.argmax() == pytest.approx(880, abs=1)


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
    espeak: str, tmp_path: Path, recognizer: whisper.Whisper, text: str, command: Command | None
) -> None:
    """With the words of the grammar, or as nothing."""
    found = recognizer.recognize(said(espeak, tmp_path, text), VOCABULARY.grammar(confirming=True))
    assert VOCABULARY.understood(found) == command, found


@pytest.mark.parametrize(
    "sound",
    [
        np.zeros(0),
        np.zeros(16_000),
        np.random.default_rng(3).normal(0, 500, 32_000),
        np.full(160_000, 3000.0),
    ],
)
def test_silence_and_noise_are_nothing(
    recognizer: whisper.Whisper, sound: "np.typing.NDArray[np.float64]"
) -> None:
    """Also digital silence, no sound at all, and more than a phrase may take."""
    found = recognizer.recognize(sound.astype(np.int16), VOCABULARY.grammar(confirming=True))
    assert VOCABULARY.understood(found) is None


def test_words_of_other_alphabets_are_told(recognizer: whisper.Whisper) -> None:
    """So their places can be named."""
    assert recognizer.words(frozenset({"table", "kitchen", "plötzensee"})) == {"table", "kitchen"}


def test_whisper_is_taken_where_it_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else pocketsphinx, which comes with the package."""
    assert best_recognizer() == WHISPER
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert best_recognizer() == SPHINX
