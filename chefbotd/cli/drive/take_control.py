"""Driving under a name: others see who drives, and whoever drove before gives way if asked to."""

import socket
from collections.abc import Awaitable, Callable
from typing import TypeVar

import click

from chefbotd.cli.common.context import Conversation
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


def lead(
    chat: Conversation,
    command: str,
    talk: Callable[[Client], Awaitable[T]],
    *,
    takes_over: bool,
    reconnect: bool = False,
) -> T:
    """Hold a conversation as ``chefbotctl COMMAND on HOST``, if asked to with control of the default source.

    Raises:
        ProgramError: whatever went wrong, with its exit code.
    """

    async def led(robot: Client) -> T:
        if takes_over:
            await robot.take_control()
        return await talk(robot)

    name = f"chefbotctl {command} on {socket.gethostname()}"[:LONGEST_NAME]
    return chat.hold(led, name=name, reconnect=reconnect)
