"""The wheels' samples of the last seconds for plotting; times are the daemon's stamps."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Curve = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WheelTrace:
    """One wheel's samples; ``age_s`` is 0 for the newest and negative before."""

    age_s: Curve
    target_rad_s: Curve
    speed_rad_s: Curve
    duty: Curve

    @property
    def error_rad_s(self) -> Curve:
        """Target minus measured speed."""
        return self.target_rad_s - self.speed_rad_s

    def rms_error_rad_s(self) -> float:
        """The root of the mean square of the error; zero before the first sample."""
        return float(np.sqrt(np.mean(self.error_rad_s**2))) if self.age_s.size else 0.0


class Trace:
    """The samples of the topic ``wheels`` no older than ``window_s``."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._samples: deque[tuple[float, Mapping[str, Any]]] = deque()

    def add(self, stamp_s: float, data: Mapping[str, Any]) -> None:
        """Add a sample. When time goes back, the daemon was restarted: a new trace begins."""
        if self._samples and stamp_s < self._samples[-1][0]:
            self._samples.clear()
        self._samples.append((stamp_s, data))
        while stamp_s - self._samples[0][0] > self._window_s:
            self._samples.popleft()

    @property
    def wheels(self) -> Sequence[str]:
        """The wheels' names in the robot's order; none before the first sample."""
        return self._samples[-1][1]["name"] if self._samples else ()

    def of(self, wheel: str) -> WheelTrace:
        """One wheel's curves; empty before the first sample.

        Raises:
            ValueError: the samples have no such wheel.
        """
        column = list(self.wheels).index(wheel) if self._samples else 0
        newest_s = self._samples[-1][0] if self._samples else 0.0
        return WheelTrace(
            np.array([stamp_s - newest_s for stamp_s, _ in self._samples]),
            *(
                np.array([data[key][column] for _, data in self._samples], dtype=np.float64)
                for key in ("target_rad_s", "velocity_rad_s", "duty")
            ),
        )
