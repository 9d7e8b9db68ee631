"""Finds motions that the wheels measure wrongly: a wheel that slips, a robot that is pushed, lifted or stalled."""

import math
from typing import Final

from chefbotd.core.record import MutableState

WINDOW_S: Final = (0.2, 0.4)
"""Turns are compared over a quarter of a second: the shortest that is between these, as samples come."""

LAG_DOUBT_S: Final = 0.02
"""So uncertain is the time of a reading: a change of the rate by 1 rad/s then looks like a turn of 20 mrad."""

MOVED_M: Final = 0.002
PUSHED_FACTOR: Final = 2.0
QUIET_S: Final = 0.3
"""An anomaly is over when it has not been seen for so long."""

STALLED_S: Final = 0.5
STALLED_SHARE: Final = 0.1
STALLED_FROM_RAD_S: Final = 0.3


class TurnWatch(MutableState):
    """Compares the turns by wheels and IMU over the last quarter of a second.

    ``samples`` are times, headings of the IMU, turns by the wheels (rad), and ways of the wheels (m). ``slip_s`` and
    ``push_s`` are when the two were last seen.
    """

    samples: list[tuple[float, float, float, float]] = []
    slip_s: float = -math.inf
    push_s: float = -math.inf

    def add(self, sample: tuple[float, float, float, float], limit_rad: float, share: float, *, may_slip: bool) -> float:
        """Add a sample; how far the turns differ (rad, signed) where that is an anomaly that begins now, else 0.

        A difference of ``limit_rad`` and a ``share`` of the turn is none. ``may_slip`` False: a skid steer, whose wheels always slip in a turn; only a push is seen.
        """
        samples = self.samples
        samples.append(sample)
        now_s = sample[0]
        while samples[0][0] < now_s - WINDOW_S[1]:
            del samples[0]
        before = next((s for s in reversed(samples) if s[0] <= now_s - WINDOW_S[0]), None)
        if before is None:
            return 0.0
        by_imu, by_wheels = sample[1] - before[1], sample[2] - before[2]
        off_rad = by_imu - by_wheels
        moved = sample[3] - before[3] > MOVED_M
        if moved and not may_slip:
            return 0.0
        limit_rad *= 1.0 if moved else PUSHED_FACTOR
        if abs(off_rad) <= limit_rad + share * abs(by_wheels) + LAG_DOUBT_S * self._rate_change(samples):
            return 0.0
        last_s = self.slip_s if moved else self.push_s
        if moved:
            self.slip_s = now_s
        else:
            self.push_s = now_s
        return off_rad if now_s - last_s > QUIET_S else 0.0

    @staticmethod
    def _rate_change(samples: list[tuple[float, float, float, float]]) -> float:
        """How much the turning rate by the wheels changes within the window (rad/s)."""
        first, second, last, end = samples[0], samples[1], samples[-2], samples[-1]
        before = (second[2] - first[2]) / max(second[0] - first[0], 1e-3)
        return abs((end[2] - last[2]) / max(end[0] - last[0], 1e-3) - before)

    def clear(self) -> None:
        """Forget the samples."""
        self.samples.clear()


class StallWatch(MutableState):
    """Whether a wheel that is to turn has stood for half a second; ``since_s`` is since when."""

    since_s: float | None = None
    is_stalled: bool = False
    is_unpowered: bool = False

    def add(
        self,
        stamp_s: float,
        velocity_rad_s: tuple[float, ...],
        target_rad_s: tuple[float, ...],
        duty: tuple[int, ...],
    ) -> None:
        """Add a control step."""
        self.is_unpowered = not any(duty)
        stands = any(
            abs(target) > STALLED_FROM_RAD_S and abs(velocity) < STALLED_SHARE * abs(target)
            for velocity, target in zip(velocity_rad_s, target_rad_s, strict=True)
        )
        if not stands or self.is_unpowered:
            self.since_s, self.is_stalled = None, False
        elif self.since_s is None:
            self.since_s = stamp_s
        else:
            self.is_stalled = stamp_s - self.since_s >= STALLED_S
