"""pocketsphinx with the American English model that its package brings, and rejection of other speech.

The phrase of the grammar that fits best is compared with the phones that fit best in any order (a phone loop): speech
that is none of the phrases fits its own phones much better.
"""

import itertools
import math
import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from pocketsphinx import Decoder, get_model_path

from chefbot_speech.recognition import RATE_HZ, Heard, Samples
from chefbot_speech.sound import LEAST_S, prepared

LANGUAGE_WEIGHT: Final = 2.0
PHONE_SCALE: Final = 1024.0
"""The scores of a phone loop are shifted by 10 bits (SENSCR_SHIFT in pocketsphinx), those of a grammar are not."""

LEAST_LOG: Final = -700.0
"""Where a score is too small for a double."""

HYPOTHESIS_SCALE: Final = 1024.0
MOST_HYPOTHESES: Final = 300
LEAST_LEAD: Final = 100.0
"""By how much a phrase has to fit better than one of another meaning: natural logarithm of the whole."""

MOST_BEHIND: Final = 2.3
MOST_BEHIND_IN_WORD: Final = 4.8
"""How much worse than the phone loop a phrase may fit, and each word of it: natural logarithms, per frame of 10 ms."""


@dataclass(frozen=True, slots=True)
class Word:
    """A word or a phone: its frames, the last included, and the logarithm of its acoustic score."""

    text: str
    first: int
    last: int
    score: float


@dataclass(frozen=True, slots=True)
class Fit:
    """How far a phrase is behind the phone loop per frame: in the mean of its words, and in its worst word."""

    mean: float
    worst: float


class PocketSphinx:
    """Knows the words of the CMU pronouncing dictionary."""

    def __init__(self) -> None:
        model = get_model_path("en-us")
        self._decoder = Decoder(
            hmm=f"{model}/en-us",
            dict=f"{model}/cmudict-en-us.dict",
            lm=None,
            lw=LANGUAGE_WEIGHT,
            compallsen=True,  # scores of the two searches can be compared
            loglevel="FATAL",
        )
        self._decoder.add_allphone_file("phones", f"{model}/en-us-phone.lm.bin")
        self._grammar = ""

    def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """Those that the dictionary has."""
        return frozenset(word for word in candidates if self._decoder.lookup_word(word) is not None)

    def recognize(self, samples: Samples, grammar: str) -> Heard:
        """The phrase of the grammar, and how far within both limits it is; no phrase has a margin below 0."""
        if grammar != self._grammar:
            self._decoder.add_jsgf_string("phrases", grammar)
            self._grammar = grammar
        sound = prepared(samples)
        if len(sound) < LEAST_S * RATE_HZ:
            return Heard("", -1.0)
        phrase = self._decode("phrases", sound)
        rivals = self._rivals() if phrase else ()
        fit = compare(phrase, self._decode("phones", sound)) if phrase else None
        if fit is None:
            return Heard("", -1.0)
        margin = min(MOST_BEHIND - fit.mean, MOST_BEHIND_IN_WORD - fit.worst)
        return Heard(" ".join(word.text for word in phrase), margin, rivals)

    def _rivals(self) -> tuple[str, ...]:
        """Other phrases of the last decoding whose whole score is not far below the best one's."""
        best = -math.inf
        rivals: dict[str, None] = {}
        for hypothesis in itertools.islice(self._decoder.nbest(), MOST_HYPOTHESES):
            if hypothesis is None:
                break
            score = HYPOTHESIS_SCALE * _log(hypothesis.score)
            best = max(best, score)
            if score > best - LEAST_LEAD:
                rivals[re.sub(r"\(\d+\)", "", hypothesis.hypstr)] = None
        return tuple(rivals)

    def _decode(self, search: str, sound: Samples) -> list[Word]:
        """The words, or the phones, without silence."""
        decoder, scale = self._decoder, PHONE_SCALE if search == "phones" else 1.0
        decoder.activate_search(search)
        decoder.start_utt()
        decoder.process_raw(sound.tobytes(), full_utt=True)
        decoder.end_utt()
        if decoder.hyp() is None:
            return []
        return [
            Word(
                re.sub(r"\(\d+\)$", "", part.word),
                part.start_frame,
                part.end_frame,
                scale * _log(part.ascore),
            )
            for part in decoder.seg()
            if not part.word.startswith(("<", "(", "[")) and part.word != "SIL"
        ]


def compare(phrase: list[Word], phones: list[Word]) -> Fit | None:
    """None where the phone loop found nothing; it is taken to be as good in every frame of a phone."""
    if not phones:
        return None
    count = max(word.last for word in (*phrase, *phones)) + 1
    per_frame = np.zeros(count)
    for phone in phones:
        per_frame[phone.first : phone.last + 1] = phone.score / (phone.last - phone.first + 1)
    frames = [word.last - word.first + 1 for word in phrase]
    behind = [float(per_frame[word.first : word.last + 1].sum()) - word.score for word in phrase]
    return Fit(
        sum(behind) / sum(frames), max(lost / length for lost, length in zip(behind, frames, strict=True))
    )


def _log(score: float) -> float:
    return max(LEAST_LOG, math.log(score)) if score > 0.0 else LEAST_LOG
