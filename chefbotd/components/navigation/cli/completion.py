"""The places of the map in use, for the shell to complete."""

import asyncio

import click

from chefbotd.cli.common.context import CommandContext, run_until_signalled
from chefbotd.cli.common.credentials import credentials
from chefbotd.cli.common.exits import ProgramError
from chefbotd.client import ChefbotError, Client

PATIENCE_S = 1.0
"""A shell that waits longer seems to hang."""


def complete_places(ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    """The names that begin so, whatever the case; none where no daemon answers soon."""
    given = ctx.find_root().params
    if given.get("where") is None:
        return []
    try:
        shown = credentials(
            given.get("token_file"), given.get("ca"), clear_token=bool(given.get("clear_token"))
        )
        context = CommandContext(given["where"], run=ctx.obj or run_until_signalled, credentials=shown)
        names = context.run_with_client(_places)
    except (ProgramError, ChefbotError, click.UsageError, TimeoutError, OSError):
        return []
    return [name for name in names if name.casefold().startswith(incomplete.casefold())]


async def _places(robot: Client) -> list[str]:
    async with asyncio.timeout(PATIENCE_S):
        return [place.name for place in (await robot.list_places()).places]
