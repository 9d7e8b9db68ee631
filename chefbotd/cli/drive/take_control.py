"""Driving under a client name, if asked to with control taken from another client."""

import socket
from collections.abc import Awaitable, Callable
from typing import TypeVar

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.client import Client

T = TypeVar("T")

LONGEST_NAME = 64

take_over = click.option(
    "--take-over",
    "takes_over",
    is_flag=True,
    help="Take control from whoever drives; they come to rest first.",
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
