"""What a recognizer of speech has to do, so that another one can take its place."""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

RATE_HZ: Final = 16_000
"""Samples a second of what a recognizer gets: one channel, 16 bits."""

PASS: Final = 0.45
"""The low-pass filter's edge as a share of the lower rate: below its half (Nyquist), with room for the slope."""

TAPS: Final = 63

Samples = NDArray[np.int16]


@dataclass(frozen=True, slots=True)
class Heard:
    """The words that fit best, and how well: below 0 they are more likely something else.

    ``text`` is empty where nothing in the grammar fits. ``rivals`` are other phrases of the grammar that fit nearly as
    well: where one of them means something else, it is not certain which was said.
    """

    text: str
    margin: float
    rivals: tuple[str, ...] = ()

    @property
    def is_certain(self) -> bool:
        """Whether it may be taken for what was said."""
        return bool(self.text) and self.margin >= 0.0


class Recognizer(Protocol):
    """A recognizer of whole phrases. It is made and used in a process of its own, where it may take its time."""

    def words(self, candidates: frozenset[str]) -> frozenset[str]:
        """Those of the words that it can recognize."""
        ...

    def recognize(self, samples: Samples, grammar: str) -> Heard:
        """Which phrase of a JSGF grammar was said in samples at ``RATE_HZ``."""
        ...


def resampled(samples: Samples, rate_hz: int) -> Samples:
    """The same sound at ``RATE_HZ``: a windowed sinc against aliasing, then linear interpolation."""
    if rate_hz == RATE_HZ or len(samples) == 0:
        return samples
    edge = PASS * min(1.0, RATE_HZ / rate_hz)
    at = np.arange(TAPS) - TAPS // 2
    taps = 2.0 * edge * np.sinc(2.0 * edge * at) * np.hamming(TAPS)
    smooth = np.convolve(samples.astype(float), taps / taps.sum(), mode="same")
    times = np.arange(0.0, len(samples) / rate_hz, 1.0 / RATE_HZ) * rate_hz
    new = np.interp(times, np.arange(len(samples)), smooth)
    return as_samples(new)


def as_samples(sound: NDArray[np.float64]) -> Samples:
    """Rounded to 16 bits; what is too loud is clipped."""
    samples: Samples = np.clip(np.rint(sound), -32768, 32767).astype(np.int16)
    return samples
