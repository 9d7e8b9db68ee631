"""How well the wheels followed, in figures that another configuration changes."""

import math
from typing import Any


class SpeedError:
    """The wheels' errors of speed (target less measured, rad/s) and duties, as root mean squares."""

    def __init__(self) -> None:
        self._error2 = self._duty2 = 0.0
        self._count = 0

    def add(self, driven: Any) -> None:
        """A ``WheelsDriven`` as plain values."""
        for target, measured, duty in zip(
            driven["target_rad_s"], driven["velocity_rad_s"], driven["duty"], strict=True
        ):
            self._error2 += (target - measured) ** 2
            self._duty2 += duty**2
            self._count += 1

    @property
    def rms_rad_s(self) -> float | None:
        """Of all wheels and steps; None without any."""
        return math.sqrt(self._error2 / self._count) if self._count else None

    @property
    def duty_rms(self) -> float | None:
        """The same of the duties."""
        return math.sqrt(self._duty2 / self._count) if self._count else None
