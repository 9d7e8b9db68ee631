"""Drives under a client name: takes control from another client, sends commands, releases the source."""

import contextlib
import socket
from collections.abc import Awaitable, Callable, Iterator, Mapping
from typing import TypeVar

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.client import CallError, Client
from chefbotd.core.geometry import Twist2D

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
