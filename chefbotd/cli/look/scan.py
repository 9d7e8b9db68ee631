"""The command of chefbotctl that draws what a lidar sees."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, AsyncIterator
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import writing
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import CallError, Client, NotReported

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from chefbotd.client import Event
    from chefbotd.client.models import ScanData

DRAWN_HZ = 5.0
FIRST_WITHIN_S = 5.0
CAPTION_ROWS = 2
STALE_S = 1.0


@click.command()
@click.option("--once", is_flag=True, help="Draw one scan and end.")
@click.option(
    "--lidar", metavar="NAME", help="The lidar to look through; without it the first that is heard."
)
@click.option("--reach", "reach_m", type=positive, metavar="METRES", help="How far the picture reaches.")
@click.pass_obj
def scan(context: CommandContext, once: bool, lidar: str | None, reach_m: float | None) -> None:
    """Draw what a lidar sees, from above, ahead being up, until interrupted.

    With --json, a JSON object for each scan.
    """
    from chefbotd.cli.common.console import Printer

    console = Printer(highlight=False)

    async def follow(robot: Client) -> None:
        scans = _scans(robot, lidar)
        async with contextlib.aclosing(scans):
            if once:
                _print(context.as_json, await anext(scans), console, reach_m)
            elif context.as_json or not console.is_terminal:
                async for event in scans:
                    _print(context.as_json, event, console, reach_m)
            else:
                await _draw_live(scans, console, reach_m)

    context.run_with_client(follow)


async def _scans(robot: Client, lidar: str | None) -> AsyncGenerator["Event[ScanData]", None]:
    """The scans of one lidar.

    Raises:
        ProgramError: the robot has no lidar, or none that is heard; it says which there are and how they are.
    """
    try:
        async with robot.subscribe("scan", policy="ordered") as events:
            while True:
                try:
                    async with asyncio.timeout(FIRST_WITHIN_S):
                        event = await _next_of(events, lidar)
                except TimeoutError:
                    raise ProgramError(Exit.FAILED, await _why_none(robot, lidar)) from None
                lidar = event.data.lidar
                yield event
    except CallError as error:
        if error.kind != "unknown_topic":
            raise
        raise ProgramError(
            Exit.FAILED, "this robot has no lidar: its configuration has no [[lidar]]"
        ) from error


async def _next_of(events: AsyncIterator["Event[ScanData]"], lidar: str | None) -> "Event[ScanData]":
    """The next one that is new: the first may be of when somebody last looked."""
    while True:
        event = await anext(events)
        if lidar in (None, event.data.lidar) and event.age_s < STALE_S:
            return event


async def _why_none(robot: Client, lidar: str | None) -> str:
    try:
        lidars = (await robot.get_state()).lidars.lidars
        conditions = "; ".join(
            f"{row.lidar}: {row.condition}{row.reason and ', '}{row.reason}" for row in lidars
        )
    except NotReported:
        conditions = "this robot has no lidar, and a depth camera's images are drawn while it sends some"
    what = "no scan" if lidar is None else f"no scan of {lidar!r}"
    return f"{what} within {FIRST_WITHIN_S:g} s ({conditions})"


def _print(as_json: bool, event: "Event[ScanData]", console: "Console", reach_m: float | None) -> None:
    if as_json:
        output.event(as_json, event)
    else:
        with writing():
            console.print(_picture(event.data, console, reach_m))


async def _draw_live(
    scans: AsyncIterator["Event[ScanData]"], console: "Console", reach_m: float | None
) -> None:
    from rich.live import Live

    loop, drawn_s = asyncio.get_running_loop(), float("-inf")
    with writing(), Live(console=console, auto_refresh=False, screen=True) as live:
        async for event in scans:
            if loop.time() - drawn_s >= 1 / DRAWN_HZ:
                drawn_s = loop.time()
                live.update(_picture(event.data, console, reach_m), refresh=True)


def _picture(data: "ScanData", console: "Console", reach_m: float | None) -> "RenderableType":
    from rich.console import Group

    from chefbotd.cli.look.view import caption, draw_scan, points_m, reach_of

    points = points_m(data)
    reach_m = reach_m or reach_of(points)
    width, height = console.size
    drawn = draw_scan(points, width - 1, height - CAPTION_ROWS, reach_m)
    return Group(drawn, caption(data, points, reach_m))
