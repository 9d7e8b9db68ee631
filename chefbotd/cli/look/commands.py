"""The commands of chefbotctl that only read: status, watch, describe."""

from typing import Any, Literal

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive
from chefbotd.cli.common.context import CommandContext
from chefbotd.client import Client

TOPICS = (
    *("odometry", "wheels", "imu", "ranges", "battery", "link", "safety", "text", "raw", "stats"),
    *("sim", "scan", "lidars"),
)
"""For shell completion only; the daemon knows which topics exist."""


def _topics(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    return [topic for topic in TOPICS if topic.startswith(incomplete)]


@click.command()
@click.pass_obj
def status(context: CommandContext) -> None:
    """Show the robot's state: mode, pose, battery, counters."""

    async def ask(robot: Client) -> dict[str, Any]:
        hello = {"robot": robot.hello.robot, "protocol": robot.hello.protocol, "session": robot.hello.session}
        return {**hello, **await robot.call("get_state"), "stats": await robot.call("get_stats")}

    output.status(context.as_json, context.run_with_client(ask))


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
    """Print the events of each TOPIC, one per line, until interrupted."""
    policy: Literal["ordered", "latest"] = "ordered" if ordered else "latest"

    async def follow(robot: Client) -> None:
        seen = 0
        async with robot.subscribe(topics, max_rate_hz=max_rate_hz, policy=policy) as events:
            async for event in events:
                output.event(context.as_json, event)
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
