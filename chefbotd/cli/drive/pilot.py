"""Commands from keys: sent at 20 Hz while a key is held; the source is released when the key is.

Releasing a key ends only this program's own motion. A stop key stops the robot, whoever drives it.
"""

import asyncio
from collections.abc import Callable

from chefbotd.cli.drive.control import release_source
from chefbotd.cli.drive.keys import MOVES, SCALES, Keys, press, released
from chefbotd.client import CallError, Client
from chefbotd.core.geometry import STANDING, Twist2D

PERIOD_S = 0.05


class Pilot:
    """Drives a robot by keys. A refusal is passed to ``report_refusal`` and ends the motion, but not the pilot."""

    def __init__(self, robot: Client, report_refusal: Callable[[str], None]) -> None:
        self._robot, self._report_refusal = robot, report_refusal
        self._woken = asyncio.Event()
        self._stop_due = False
        self.keys = Keys()
        self.asked: Twist2D = STANDING

    def press(self, key: str) -> None:
        """Process a key from the terminal. A key that neither drives nor sets a speed stops, also at standstill."""
        self.keys = press(self.keys, key, asyncio.get_running_loop().time())
        self._stop_due = self._stop_due or key not in MOVES.keys() | SCALES.keys()
        self._woken.set()

    def release(self) -> None:
        """Treat every key as released: the terminal lost the focus, or another request comes first."""
        self.keys = released(self.keys)
        self._woken.set()

    async def run(self) -> None:
        """Send commands until cancelled, and release the source at the end. Raises client errors other than refusals."""
        try:
            while True:
                await self._send()
                await self._wait()
        finally:
            moving, self.asked = self.asked != STANDING, STANDING
            if moving and self._robot.connected:
                await release_source(self._robot)

    async def _send(self) -> None:
        self._woken.clear()
        wanted = self.keys.twist(asyncio.get_running_loop().time())
        stop_due, self._stop_due = self._stop_due, False
        before, self.asked = self.asked, wanted
        try:
            if stop_due:
                await self._robot.stop()
            if wanted != STANDING:
                await self._robot.drive(wanted.linear_m_s, wanted.angular_rad_s)
            elif before != STANDING and not stop_due:
                await release_source(self._robot)
        except CallError as error:
            self.keys, self.asked = released(self.keys), STANDING
            self._report_refusal(f"{error.kind}: {error.message}")

    async def _wait(self) -> None:
        """Wait for the next key, the next period, or the moment at which the key counts as released."""
        if self.asked == STANDING:
            await self._woken.wait()
            return
        left_s = self.keys.until_s - asyncio.get_running_loop().time()
        try:
            async with asyncio.timeout(min(PERIOD_S, max(left_s, 0.0))):
                await self._woken.wait()
        except TimeoutError:
            return
