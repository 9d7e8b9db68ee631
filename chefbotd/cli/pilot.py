"""From keys to commands: what the keys ask for, sent at 20 Hz while one is held, and one stop when it is let go."""

import asyncio
from collections.abc import Callable

from chefbotd.cli.keys import MOVES, SCALES, KeyParameters, Keys, press, released, untouched
from chefbotd.client import CallError, Client
from chefbotd.core.geometry import STANDING, Twist2D

PERIOD_S = 0.05


class Pilot:
    """Drives a robot by keys; ``complain`` is told of every refusal, which ends the motion but not the pilot."""

    def __init__(
        self, robot: Client, complain: Callable[[str], None], parameters: KeyParameters | None = None
    ) -> None:
        self._robot, self._complain = robot, complain
        self._parameters = parameters or KeyParameters()
        self._woken = asyncio.Event()
        self._stop_due = False
        self.keys: Keys = untouched(self._parameters)
        self.asked: Twist2D = STANDING

    def press(self, key: str) -> None:
        """A key arrived from the terminal. One that neither drives nor sets a speed stops, even at rest."""
        self.keys = press(self._parameters, self.keys, key, asyncio.get_running_loop().time())
        self._stop_due = self._stop_due or key not in MOVES.keys() | SCALES.keys()
        self._woken.set()

    def release(self) -> None:
        """Whatever was held is not any more: the terminal lost the focus, or something else has to come first."""
        self.keys = released(self.keys)
        self._stop_due = True
        self._woken.set()

    async def run(self) -> None:
        """Send commands until cancelled, and a stop on every way out; raises the client's errors but refusals."""
        try:
            while True:
                await self._send()
                await self._wait()
        finally:
            self.asked = STANDING
            if self._robot.connected:
                await self._robot.stop()

    async def _send(self) -> None:
        self._woken.clear()
        wanted = self.keys.twist(asyncio.get_running_loop().time())
        stop_due, self._stop_due = self._stop_due or self.asked != STANDING, False
        self.asked = wanted
        try:
            if wanted != STANDING:
                await self._robot.drive(wanted.linear_m_s, wanted.angular_rad_s)
            elif stop_due:
                await self._robot.stop()
        except CallError as error:
            self.keys, self.asked = released(self.keys), STANDING
            self._complain(f"{error.kind}: {error.message}")

    async def _wait(self) -> None:
        """Until the next key, the next command's turn, or the moment at which the key counts as let go."""
        if self.asked == STANDING:
            await self._woken.wait()
            return
        left_s = self.keys.until_s - asyncio.get_running_loop().time()
        try:
            async with asyncio.timeout(min(PERIOD_S, max(left_s, 0.0))):
                await self._woken.wait()
        except TimeoutError:
            return
