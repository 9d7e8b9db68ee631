"""Drives under a client name: takes control from another client, sends commands, releases the source."""

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable, Iterator, Mapping
from typing import TypeVar

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.drive.keys import MOVES, SCALES, Keys, press, release_keys
from chefbotd.client import CallError, Client, MotionInterrupted
from chefbotd.core.geometry import STANDING, Twist2D

T = TypeVar("T")

LONGEST_NAME = 64

take_over = click.option(
    "--take-over",
    "takes_over",
    is_flag=True,
    help="Take control from another driver, who is stopped first.",
)
"""The option of every command that drives."""


def run_as_driver(
    context: CommandContext,
    command: str,
    action: Callable[[Client], Awaitable[T]],
    *,
    takes_over: bool,
    reconnect: bool = False,
) -> T:
    """Run ``action`` as the client ``chefbotctl COMMAND on HOST``; with ``takes_over`` take control first.

    Raises:
        ProgramError: any failure, with its exit code.
    """

    async def as_driver(robot: Client) -> T:
        if takes_over:
            await robot.take_control()
        return await action(robot)

    name = f"chefbotctl {command} on {socket.gethostname()}"[:LONGEST_NAME]
    return context.run_with_client(as_driver, name=name, reconnect=reconnect)


@contextlib.contextmanager
def ignoring_too_old() -> Iterator[None]:
    """A command that was refused as too late moved nothing, and the next one follows in a moment.

    That happens on a busy computer. Raises the client's other errors.
    """
    try:
        yield
    except CallError as error:
        if error.kind != "too_old":
            raise


async def send_drive(robot: Client, twist: Twist2D) -> None:
    """Drive so, unless the command is too late."""
    with ignoring_too_old():
        await robot.drive(twist.linear_m_s, twist.angular_rad_s)


async def arm_seen(robot: Client) -> None:
    """Clear what has latched by now; what latches while this is on its way holds."""
    await robot.arm((await robot.get_state()).safety.latch)


async def release_source(robot: Client, source: str | None = None) -> None:
    """Set our own target to zero, then release our sources. If the release is refused, send a stop, which never is."""
    with contextlib.suppress(
        CallError
    ):  # disarmed, or another client has control: our command does not move the robot
        await robot.drive(0.0, 0.0, source)
    try:
        await robot.release_control()
    except CallError:
        await robot.stop()


def describe_stop(drivers: Mapping[str, str]) -> str:
    """The message after a stop, with who was driving."""
    if not drivers:
        return "Stopped; nobody was driving."
    who = ", ".join(f"{source} was driven by {client}" for source, client in drivers.items())
    return f"Stopped; {who}. Other drivers are refused until they release the robot."


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
        self.keys = release_keys(self.keys)
        self._woken.set()

    async def run(self) -> None:
        """Send commands until cancelled, and release the source at the end. Raises client errors other than refusals."""
        try:
            while True:
                await self._send_command()
                await self._wait()
        finally:
            moving, self.asked = self.asked != STANDING, STANDING
            if moving and self._robot.connected:
                await release_source(self._robot)

    async def _send_command(self) -> None:
        self._woken.clear()
        command = self.keys.twist(asyncio.get_running_loop().time())
        stop_due, self._stop_due = self._stop_due, False
        before, self.asked = self.asked, command
        try:
            if stop_due:
                await self._robot.stop()
            if command != STANDING:
                await self._robot.drive(command.linear_m_s, command.angular_rad_s)
            elif before != STANDING and not stop_due:
                await release_source(self._robot)
        except CallError as error:
            self.keys, self.asked = release_keys(self.keys), STANDING
            self._report_refusal(f"{error.kind}: {error.message}")
        except MotionInterrupted as error:
            self.keys, self.asked = release_keys(self.keys), STANDING
            self._report_refusal(str(error))

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
