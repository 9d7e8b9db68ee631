"""A square wave in speed, forward and backward, to show the wheels' step response."""

import asyncio
from collections.abc import Callable

from chefbotd.cli.drive.control import release_source
from chefbotd.client import CallError, Client, MotionInterrupted
from chefbotd.core.record import Record

PERIOD_S = 0.05
"""20 Hz, ten times within the daemon's dead-man of 0.5 s."""


class Wave(Record, frozen=True):
    """``half_period_s`` forward at ``amplitude_m_s``, then as long backward; the command's options bound both."""

    amplitude_m_s: float
    half_period_s: float


def speed_m_s(wave: Wave, elapsed_s: float) -> float:
    """The speed ``elapsed_s`` after the start; the first half period is forward."""
    forward = elapsed_s % (2 * wave.half_period_s) < wave.half_period_s
    return wave.amplitude_m_s if forward else -wave.amplitude_m_s


class Exciter:
    """Drives the wave while it is on. A refusal is passed to ``report_refusal`` and turns it off."""

    def __init__(self, robot: Client, wave: Wave, report_refusal: Callable[[str], None]) -> None:
        self._robot, self._wave, self._report_refusal = robot, wave, report_refusal
        self._changed = asyncio.Event()
        self._driving = self._stop_due = False
        self.on = False

    def start(self) -> None:
        """Start with a step forward."""
        self.on = True
        self._changed.set()

    def end(self) -> None:
        """End the wave: our own motion, and nobody else's."""
        self.on = False
        self._changed.set()

    def stop(self) -> None:
        """End the wave and stop the robot, whoever drives it."""
        self._stop_due = True
        self.end()

    async def run(self) -> None:
        """Run until cancelled, and then end a wave that is on. Raises client errors other than refusals."""
        try:
            while True:
                await self._changed.wait()
                self._changed.clear()
                await self._drive()
        finally:
            if self._driving and self._robot.connected:
                await release_source(self._robot)

    async def _drive(self) -> None:
        """Drive the wave while it is on. A stop, or the zero at its end, is sent at once."""
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        try:
            while self.on:
                self._driving = True
                await self._robot.drive(speed_m_s(self._wave, loop.time() - began_s), 0.0)
                await self._pause()
            stop_due, self._stop_due = self._stop_due, False
            if stop_due:
                await self._robot.stop()
            elif self._driving:
                await release_source(self._robot)
            self._driving = False
        except CallError as error:
            self.on = False
            self._report_refusal(f"{error.kind}: {error.message}")
        except MotionInterrupted as error:
            self.on = False
            self._report_refusal(str(error))

    async def _pause(self) -> None:
        try:
            async with asyncio.timeout(PERIOD_S):
                await self._changed.wait()
        except TimeoutError:
            return
        self._changed.clear()
