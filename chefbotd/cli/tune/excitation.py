"""A square wave in speed, forward and back, so that one sees how the wheels answer a step."""

import asyncio
from collections.abc import Callable

from pydantic import Field

from chefbotd.client import CallError, Client
from chefbotd.core.parameters import Parameters

PERIOD_S = 0.05
"""20 Hz, ten times within the daemon's dead-man of 0.5 s."""


class WaveParameters(Parameters):
    """``half_period_s`` forward at ``amplitude_m_s``, as long backwards: the robot ends where it began.

    The amplitude is bounded to what stays harmless when somebody forgot to lift the wheels off the ground.
    """

    amplitude_m_s: float = Field(0.1, gt=0, le=0.2)
    half_period_s: float = Field(1.5, ge=0.5, le=5)


def speed_m_s(parameters: WaveParameters, elapsed_s: float) -> float:
    """What to drive ``elapsed_s`` after the beginning, which is forward."""
    forward = elapsed_s % (2 * parameters.half_period_s) < parameters.half_period_s
    return parameters.amplitude_m_s if forward else -parameters.amplitude_m_s


class Exciter:
    """Drives the wave while it is on; ``complain`` is told of a refusal, which turns it off."""

    def __init__(self, robot: Client, parameters: WaveParameters, complain: Callable[[str], None]) -> None:
        self._robot, self._parameters, self._complain = robot, parameters, complain
        self._changed = asyncio.Event()
        self._stop_due = False
        self.on = False

    def start(self) -> None:
        """Begin with a step forward."""
        self.on = True
        self._changed.set()

    def stop(self) -> None:
        """End, and have the robot come to rest."""
        self.on = False
        self._changed.set()

    async def run(self) -> None:
        """Until cancelled, and then a stop if it has driven since the last; raises the client's errors but refusals."""
        try:
            while True:
                await self._changed.wait()
                self._changed.clear()
                await self._drive()
        finally:
            if self._stop_due and self._robot.connected:
                await self._robot.stop()

    async def _drive(self) -> None:
        """The wave, for as long as it is on; the stop at its end is sent at once."""
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        try:
            while self.on:
                self._stop_due = True
                await self._robot.drive(speed_m_s(self._parameters, loop.time() - began_s), 0.0)
                await self._pause()
            await self._robot.stop()
            self._stop_due = False
        except CallError as error:
            self.on = False
            self._complain(f"{error.kind}: {error.message}")

    async def _pause(self) -> None:
        try:
            async with asyncio.timeout(PERIOD_S):
                await self._changed.wait()
        except TimeoutError:
            return
        self._changed.clear()
