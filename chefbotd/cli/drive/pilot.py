"""From keys to commands: what the keys ask for, sent at 20 Hz while one is held, and given back when it is let go.

Letting go ends this program's own motion and no other's. Only a key that stops, stops whoever drives.
"""

import asyncio
import contextlib
from collections.abc import Callable, Mapping

from chefbotd.cli.drive.keys import MOVES, SCALES, KeyParameters, Keys, press, released, untouched
from chefbotd.client import CallError, Client
from chefbotd.core.geometry import STANDING, Twist2D

PERIOD_S = 0.05


async def let_go(robot: Client, source: str | None = None) -> None:
    """Our own target to zero, then our source given back. Where that is refused, a stop, which never is."""
    with contextlib.suppress(CallError):  # disarmed, or another's by now: nothing of ours moves the robot
        await robot.drive(0.0, 0.0, source)
    try:
        await robot.release_control()
    except CallError:
        await robot.stop()


def told_of_stop(drivers: Mapping[str, str]) -> str:
    """What a stop is told as: who was driving is held until it lets go."""
    if not drivers:
        return "Stopped; nobody was driving."
    who = ", ".join(f"{source} was driven by {client}" for source, client in drivers.items())
    return f"Stopped; {who}. Other drivers are refused until they let go."


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
        self._woken.set()

    async def run(self) -> None:
        """Send commands until cancelled, and let go on every way out; raises the client's errors but refusals."""
        try:
            while True:
                await self._send()
                await self._wait()
        finally:
            moving, self.asked = self.asked != STANDING, STANDING
            if moving and self._robot.connected:
                await let_go(self._robot)

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
                await let_go(self._robot)
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
