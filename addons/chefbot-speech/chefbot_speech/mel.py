"""What Whisper gets of sound: a log-Mel spectrogram (Radford et al. 2022, section 2.2)."""

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from chefbot_speech.recognition import RATE_HZ, Samples

WINDOW, HOP, BANDS = 400, 160, 80
DYNAMIC: Final = 8.0
"""What is quieter than the loudest by so many powers of ten counts as silence."""

KNEE_HZ, HZ_PER_MEL, KNEE_MEL, MELS_PER_E = 1000.0, 200.0 / 3.0, 15.0, 27.0 / np.log(6.4)
"""Slaney's scale (Auditory Toolbox, 1998): linear up to 1 kHz, logarithmic beyond."""

FULL_SCALE: Final = 32_768.0
Floats = NDArray[np.float64]


def log_mel(samples: Samples, seconds: float) -> NDArray[np.float32]:
    """Of so many seconds, with silence behind the samples: 80 bands, each of 100 frames a second."""
    count = round(seconds * RATE_HZ)
    sound = np.zeros(count)
    sound[: min(count, len(samples))] = samples[:count] / FULL_SCALE
    padded = np.pad(sound, WINDOW // 2, mode="reflect")
    frames = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP][: count // HOP]
    power = np.abs(np.fft.rfft(frames * np.hanning(WINDOW + 1)[:-1])) ** 2
    levels = np.log10(np.maximum(filters() @ power.T, 1e-10))
    return np.asarray((np.maximum(levels, levels.max() - DYNAMIC) + 4.0) / 4.0, dtype=np.float32)


@cache
def filters() -> Floats:
    """A triangle for each band, of the same area each, over the frequencies of a window."""
    top_mel = KNEE_MEL + MELS_PER_E * np.log(RATE_HZ / 2 / KNEE_HZ)
    edges_hz = _hz(np.linspace(0.0, top_mel, BANDS + 2))
    widths_hz = np.diff(edges_hz)
    above_hz = np.fft.rfftfreq(WINDOW, 1.0 / RATE_HZ) - edges_hz[:, np.newaxis]
    rising = above_hz[:-2] / widths_hz[:-1, np.newaxis]
    falling = -above_hz[2:] / widths_hz[1:, np.newaxis]
    triangles = np.maximum(0.0, np.minimum(rising, falling))
    return np.asarray(triangles * (2.0 / (edges_hz[2:] - edges_hz[:-2]))[:, np.newaxis])


def _hz(mel: Floats) -> Floats:
    return np.where(mel < KNEE_MEL, mel * HZ_PER_MEL, KNEE_HZ * np.exp((mel - KNEE_MEL) / MELS_PER_E))
