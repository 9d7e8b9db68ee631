"""The commands of chefbotctl that only look: status, watch, describe."""

from typing import Any, Literal

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive
from chefbotd.cli.common.context import Conversation
from chefbotd.client import Client

TOPICS = ("odometry", "wheels", "imu", "ranges", "battery", "link", "safety", "text", "raw", "stats", "sim")
"""For completion only: the daemon has the last word on what there is."""


def _topics(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    return [topic for topic in TOPICS if topic.startswith(incomplete)]


@click.command()
@click.pass_obj
def status(chat: Conversation) -> None:
    """Show the robot's state: mode, pose, battery, counters."""

    async def ask(robot: Client) -> dict[str, Any]:
        hello = {"robot": robot.hello.robot, "protocol": robot.hello.protocol, "session": robot.hello.session}
        return {**hello, **await robot.call("get_state"), "stats": await robot.call("get_stats")}

    output.status(chat.as_json, chat.hold(ask))


@click.command()
@click.argument("topics", metavar="TOPIC...", nargs=-1, required=True, shell_complete=_topics)
@click.option("--rate", "max_rate_hz", type=positive, metavar="HZ", help="At most so many a second.")
@click.option("--count", type=click.IntRange(min=1), help="End after so many events.")
@click.option("--ordered", is_flag=True, help="Every event in order, rather than the latest.")
@click.pass_obj
def watch(
    chat: Conversation, topics: tuple[str, ...], max_rate_hz: float | None, count: int | None, ordered: bool
) -> None:
    """Print the events of each TOPIC as they come.

    One a line, until interrupted.
    """
    policy: Literal["ordered", "latest"] = "ordered" if ordered else "latest"

    async def follow(robot: Client) -> None:
        seen = 0
        async with robot.subscribe(topics, max_rate_hz=max_rate_hz, policy=policy) as events:
            async for event in events:
                output.event(chat.as_json, event)
                seen += 1
                if seen == count:
                    return

    chat.hold(follow)


@click.command()
@click.pass_obj
def describe(chat: Conversation) -> None:
    """Show the daemon's methods and topics.

    With --json, their JSON Schemas.
    """
    output.description(chat.as_json, chat.hold(lambda robot: robot.call("describe")))
