"""The motion processor of the MPU-6050: it takes a sample every period, and keeps samples until they are read."""

from collections import deque
from typing import NamedTuple

from chefbotd.sim.plant import Wheels
from chefbotd.sim.robot import Robot
from chefbotd.sim.sensors import Motion

FIFO_SAMPLES = 24
"""1024 bytes of FIFO (register map RM-MPU-6000A, section 4.33) at 42 bytes each."""


class Sample(NamedTuple):
    """A motion, and when it was sampled."""

    at_s: float
    motion: Motion


class MotionProcessor:
    """Samples a robot's motion on a grid of its own, from when it was started."""

    def __init__(self, robot: Robot, period_s: float) -> None:
        self._robot, self._period_s = robot, period_s
        self._samples: deque[Sample] = deque()
        self._next_s = period_s
        robot.watch(self._watch)

    def start(self, at_s: float) -> None:
        """An empty FIFO; the first sample comes a period later."""
        self._samples.clear()
        self._next_s = at_s + self._period_s

    @property
    def ready_s(self) -> float:
        """When the oldest sample is available."""
        return self._samples[0].at_s if self._samples else self._next_s

    def read(self, now_s: float) -> Sample | None:
        """The oldest sample; None where there is none, or the FIFO has overflowed, which empties it."""
        waiting = sum(sample.at_s <= now_s for sample in self._samples)
        if waiting > FIFO_SAMPLES:
            for _ in range(waiting):
                self._samples.popleft()
            return None
        return self._samples.popleft() if waiting else None

    def _watch(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        while self._next_s <= to_s:
            self._samples.append(Sample(self._next_s, self._robot.motion))
            self._next_s += self._period_s
