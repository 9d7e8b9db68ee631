"""How many phrases are understood, and how much other speech is taken for one.

    python -m benchmarks.phrases [--tuning] [MODULE:CLASS]

measures the recognizer of that name, else the one that the program would take; all voices together, and each alone.
Synthetic voices that were not tuned on, clean and with white noise at 20 dB; and people who read something else, from
the Debian package pocketsphinx-testdata where it is installed. There are no recordings of people who say these phrases.
"""

import importlib
import subprocess
import sys
import tempfile
import time
import wave
from collections.abc import Iterator
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from chefbot_speech.commands import Command, Vocabulary
from chefbot_speech.ear import best_recognizer
from chefbot_speech.recognition import RATE_HZ, Recognizer, Samples, resampled

from benchmarks.corpus import HELD_OUT, TUNING, Corpus
from chefbotd.client.models import PlaceData

PEAK: Final = 12_000.0
SILENCE_S, HISS = 0.25, 3.0
PEOPLE: Final = Path("/usr/share/pocketsphinx/test/data")
PLACES: Final = (
    *(PlaceData(f"table {number}", 0.0, 0.0, 0.0, "table") for number in range(1, 11)),  # type: ignore[arg-type]
    PlaceData("kitchen", 0.0, 0.0, 0.0, "home"),  # type: ignore[arg-type]
    PlaceData("dock", 0.0, 0.0, 0.0, "dock"),  # type: ignore[arg-type]
)


@dataclass
class Count:
    """What came of so many phrases, or of so many other sentences."""

    phrases: int = 0
    right: int = 0
    wrong_goals: int = 0
    others: int = 0
    taken: int = 0

    def __add__(self, other: "Count") -> "Count":
        return Count(*(mine + theirs for mine, theirs in zip(astuple(self), astuple(other), strict=True)))

    def line(self) -> str:
        """Shares in percent."""
        right, wrong = 100 * self.right / max(1, self.phrases), 100 * self.wrong_goals / max(1, self.phrases)
        taken = 100 * self.taken / max(1, self.others)
        return (
            f"{self.phrases:4d} phrases: right {right:5.1f} %, another goal proposed {wrong:4.1f} %;"
            f" {self.others:4d} others: taken for a command {taken:4.1f} %"
        )


def read(path: Path) -> Samples:
    """A WAV file, or raw samples at 16 kHz, with one channel."""
    if path.suffix == ".raw":
        return np.fromfile(path, dtype="<i2")
    with wave.open(str(path)) as sound:
        samples = np.frombuffer(sound.readframes(sound.getnframes()), dtype="<i2")
        return resampled(samples, sound.getframerate())


def synthesized(voice: str, text: str, folder: Path) -> Samples:
    """What a program says."""
    program, _, name = voice.partition(":")
    path = folder / "said.wav"
    flite = ("flite", "-voice", name, "-t", text, "-o", str(path))
    espeak = ("espeak-ng", "-v", name, "-w", str(path), "--", text)
    subprocess.run(flite if program == "flite" else espeak, check=True)
    return read(path)


def in_room(said: Samples, snr_db: float | None, seed: int) -> Samples:
    """With silence around it, and noise: white, below the mean power of the speech by so much; None: a hiss."""
    silence = np.zeros(int(SILENCE_S * RATE_HZ))
    sound = np.concatenate(
        [silence, said * (PEAK / max(1.0, float(np.abs(said.astype(float)).max()))), silence]
    )
    rms = float(np.sqrt(np.mean(sound[sound != 0.0] ** 2)))
    noise = HISS if snr_db is None else rms / 10 ** (snr_db / 20)
    return np.clip(sound + np.random.default_rng(seed).normal(0.0, noise, len(sound)), -32768, 32767).astype(
        "<i2"
    )


def said(corpus: Corpus) -> Iterator[tuple[str, str, str]]:
    """Voice, text and what it asks for: each phrase in all voices, each other sentence in three of them."""
    for voice in corpus.voices:
        for text, wanted in corpus.phrases:
            yield voice, text, wanted
    for index, text in enumerate(corpus.others):
        for voice in corpus.voices[index % 2 :: 2]:
            yield voice, text, ""


def name_of(command: Command | None) -> str:
    """As the corpus has it."""
    return "" if command is None else f"{command.action} {command.place}".strip()


def digits(wanted: str) -> str:
    """``go table three`` as the name of the command."""
    command = VOCABULARY.meaning(wanted.replace("go ", "go to ") if wanted.startswith("go ") else wanted)
    return name_of(command)


VOCABULARY: Final = Vocabulary.of(PLACES)
GRAMMAR: Final = VOCABULARY.grammar(confirming=False)


def measure(corpus: Corpus, snr_db: float | None, folder: Path, recognizer: Recognizer) -> dict[str, Count]:
    """All of a corpus, by voice."""
    counts = {voice: Count() for voice in corpus.voices}
    for seed, (voice, text, wanted) in enumerate(said(corpus)):
        count = counts[voice]
        heard = recognizer.recognize(in_room(synthesized(voice, text, folder), snr_db, seed), GRAMMAR)
        got = name_of(VOCABULARY.understood(heard))
        if wanted:
            count.phrases += 1
            count.right += got == digits(wanted)
            count.wrong_goals += got.startswith("go") and got != digits(wanted)
        else:
            count.others += 1
            count.taken += bool(got)
    return counts


def people(recognizer: Recognizer) -> Count:
    """Of people who read a novel, numbers and cards, nothing is a command."""
    count = Count()
    for path in sorted((*PEOPLE.rglob("*.wav"), *PEOPLE.rglob("*.raw"))):
        sound = read(path)
        for first in range(0, len(sound), 4 * RATE_HZ):
            piece = sound[first : first + 4 * RATE_HZ]
            if len(piece) < RATE_HZ // 2:
                continue
            heard = recognizer.recognize(piece, GRAMMAR)
            count.others += 1
            count.taken += VOCABULARY.understood(heard) is not None
    return count


def main() -> None:
    """Print the figures; with ``--tuning`` those of the half that was tuned on."""
    names = [word for word in sys.argv[1:] if not word.startswith("-")] or [best_recognizer()]
    module, _, kind = names[0].partition(":")
    recognizer: Recognizer = getattr(importlib.import_module(module), kind)()
    print(names[0])
    corpus = TUNING if "--tuning" in sys.argv else HELD_OUT
    with tempfile.TemporaryDirectory() as folder:
        for snr_db in (None, 20.0):
            began_s = time.process_time()
            counts = measure(corpus, snr_db, Path(folder), recognizer)
            total = sum(counts.values(), Count())
            cpu_s = (time.process_time() - began_s) / (total.phrases + total.others)
            print(f"{'clean' if snr_db is None else '20 dB'}: {total.line()}; {cpu_s:.2f} CPU s each")
            for voice, count in counts.items():
                print(f"    {voice}: {count.line()}", flush=True)
    if PEOPLE.is_dir():
        print(f"people: {people(recognizer).line()}")
    else:
        print("people: apt-get install pocketsphinx-testdata")


if __name__ == "__main__":
    main()
