"""What a recognizer gets of what a microphone has taken up: the part in which somebody speaks, with less noise."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbot_speech.recognition import RATE_HZ, Samples, as_samples

LEAST_S, MARGIN_S, WINDOW_S = 0.15, 0.15, 0.025
QUIET, ABOVE_NOISE = 0.03, 1.5
"""Sound below this share of the loudest, or this many times the noise, is cut off at both ends."""

BLOCK, STEP = 512, 128
NOISE_SHARE: Final = 8
"""The quietest of so many blocks of 32 ms are taken for noise alone."""

AUDIBLE: Final = 1e-4
"""Noise of less power than this share of speech is left as it is: taking it off would do more harm."""

FLOOR: Final = 0.2
"""What is left of noise: less sounds like other phones."""

DITHER: Final = 30.0
"""The standard deviation of noise that is added, in steps of 16 bits: the model knows no digital silence."""


def prepared(samples: Samples) -> Samples:
    """The part in which somebody speaks, with a little before and after it; the same in every call."""
    if len(samples) == 0:
        return samples
    clean = without_noise(samples.astype(float))
    window = int(WINDOW_S * RATE_HZ)
    loud = np.convolve(np.abs(clean), np.ones(window) / window, mode="same")
    speech = np.flatnonzero(loud > _limit(loud))
    if len(speech) == 0:
        return samples[:0]
    margin = int(MARGIN_S * RATE_HZ)
    cut = clean[max(0, speech[0] - margin) : speech[-1] + margin]
    noise = np.random.default_rng(1).normal(0.0, DITHER, len(cut))
    return as_samples(cut + noise)


def speech_end(samples: Samples, rate_hz: int) -> int:
    """How many samples it takes until nobody speaks any more, in steps of a window; 0: nobody has spoken."""
    window = int(WINDOW_S * rate_hz)
    whole = samples[: len(samples) // window * window].astype(float)
    if len(whole) == 0:
        return 0
    loud = np.abs(whole.reshape(-1, window)).mean(axis=1)
    speech = np.flatnonzero(loud > _limit(loud))
    return int(speech[-1] + 1) * window if len(speech) else 0


def _limit(loud: NDArray[np.float64]) -> float:
    """What is quieter is no speech."""
    return float(max(QUIET * loud.max(), ABOVE_NOISE * np.percentile(loud, 5)))


def without_noise(sound: NDArray[np.float64]) -> NDArray[np.float64]:
    """Steady noise is taken off by spectral subtraction (Boll 1979), of power, down to a floor."""
    if len(sound) < 2 * BLOCK:
        return sound
    padded = np.concatenate([np.zeros(BLOCK), sound, np.zeros(2 * BLOCK)])
    window = np.hanning(BLOCK + 1)[:-1]
    spectra = np.fft.rfft(np.lib.stride_tricks.sliding_window_view(padded, BLOCK)[::STEP] * window)
    power = np.abs(spectra) ** 2
    energy = power.sum(axis=1)
    inside = np.flatnonzero(energy > 0.0)[BLOCK // STEP : -BLOCK // STEP]  # no block that is partly padding
    quietest = inside[np.argsort(energy[inside])[: max(4, len(inside) // NOISE_SHARE)]]
    if len(quietest) == 0:
        return sound
    if energy[quietest].mean() < AUDIBLE * np.percentile(energy, 95):
        return sound
    noise = power[quietest].mean(axis=0)
    gain = np.sqrt(np.maximum(1.0 - noise / np.maximum(power, 1e-9), FLOOR**2))
    blocks = np.fft.irfft(spectra * gain) * window
    total, weight = np.zeros(len(padded)), np.zeros(len(padded))
    for index, block in enumerate(blocks):
        total[index * STEP : index * STEP + BLOCK] += block
        weight[index * STEP : index * STEP + BLOCK] += window**2
    return (total / np.maximum(weight, 1e-3))[BLOCK : BLOCK + len(sound)]
