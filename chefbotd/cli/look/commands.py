"""The commands of chefbotctl that only read: status, watch, describe."""

from collections.abc import Mapping
from typing import Any, Literal

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import need_terminal
from chefbotd.cli.look.fields import EVERY, follow, select, state_of
from chefbotd.client import Client

TOPICS = (
    *("odometry", "wheels", "imu", "ranges", "battery", "link", "safety", "text", "raw", "stats"),
    *("sim", "scan", "lidars", "depth_cameras", "worker", "mapping", "map", "map_pose", "localization"),
    *("navigation", "path", "costmap", "obstacles", "recording", "reset", EVERY),
)
"""For shell completion only; the daemon knows which topics exist."""


def _topics(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    return [topic for topic in TOPICS if topic.startswith(incomplete)]


@click.command()
@click.option("--watch", "watches", is_flag=True, help="Redraw it twice a second, until interrupted.")
@click.pass_obj
def status(context: CommandContext, watches: bool) -> None:
    """Show the robot's state: mode, pose, battery, goal, map, worker, counters.

    With --watch and --json, an object per line.
    """
    if watches:
        _watch_status(context)
    else:
        output.status(context.as_json, context.run_with_client(state_of))


def _watch_status(context: CommandContext) -> None:
    if context.as_json:
        context.run_with_client(lambda robot: follow(robot, _print_state), reconnect=True)
        return
    need_terminal()
    from chefbotd.cli.look.board import board

    with board() as show:
        context.run_with_client(lambda robot: follow(robot, show), reconnect=True)


def _print_state(state: Mapping[str, Any] | None, trouble: str) -> None:
    """A line of JSON for each new state; without an answer there is none."""
    if state is not None and not trouble:
        output.status(True, state)


@click.command()
@click.argument("topics", metavar="TOPIC...", nargs=-1, required=True, shell_complete=_topics)
@click.option("--rate", "max_rate_hz", type=positive, metavar="HZ", help="At most HZ events a second.")
@click.option("--count", type=click.IntRange(min=1), help="End after COUNT events.")
@click.option("--ordered", is_flag=True, help="Every event in order, rather than the latest.")
@click.pass_obj
def watch(
    context: CommandContext,
    topics: tuple[str, ...],
    max_rate_hz: float | None,
    count: int | None,
    ordered: bool,
) -> None:
    """Print the events of each TOPIC, one per line, until interrupted.

    TOPIC.FIELD prints that field alone, such as odometry.x_m or wheels.duty.0; 'all' is every topic.
    """
    policy: Literal["ordered", "latest"] = "ordered" if ordered else "latest"

    async def follow(robot: Client) -> None:
        seen, selection = 0, select(topics, robot.hello.capabilities)
        async with robot.subscribe(selection.topics, max_rate_hz=max_rate_hz, policy=policy) as events:
            async for event in events:
                output.event(context.as_json, event, selection.of)
                seen += 1
                if seen == count:
                    return

    context.run_with_client(follow)


@click.command()
@click.pass_obj
def describe(context: CommandContext) -> None:
    """Show the daemon's methods and topics.

    With --json, their JSON Schemas.
    """
    output.description(context.as_json, context.run_with_client(lambda robot: robot.call("describe")))
