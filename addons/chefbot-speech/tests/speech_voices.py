"""A voice for the tests of recognizers."""

import subprocess
import wave
from pathlib import Path

import numpy as np
from chefbot_speech.recognition import Samples, resampled


def said(espeak: str, folder: Path, text: str) -> Samples:
    """What espeak-ng says, as a microphone has it."""
    path = folder / "said.wav"
    subprocess.run([espeak, "-v", "en-us+m3", "-w", str(path), "--", text], check=True)
    with wave.open(str(path)) as sound:
        samples = np.frombuffer(sound.readframes(sound.getnframes()), dtype="<i2")
        hiss = np.random.default_rng(1).normal(0.0, 5.0, len(samples))
        return resampled((samples // 2 + hiss).astype(np.int16), sound.getframerate())
