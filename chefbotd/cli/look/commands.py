"""The commands of chefbotctl that only read: status, watch, describe; and which fields of an event ``watch`` prints."""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import need_terminal
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import ChefbotError, Client
from chefbotd.core.record import Record

EVERY = "all"


class Selection(Record, frozen=True):
    """The topics to subscribe to, and for each the fields to print (none: all of them)."""

    fields: Mapping[str, tuple[str, ...]]

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics."""
        return tuple(self.fields)

    def of(self, topic: str, data: Mapping[str, Any]) -> dict[str, Any]:
        """The selected part of a topic's data, by the names that were asked for.

        Raises:
            ProgramError: there is no such field; the message names those that there are.
        """
        names = self.fields[topic]
        return {name: _value(topic, name, data) for name in names} if names else dict(data)


def select(words: Iterable[str], capabilities: Iterable[str]) -> Selection:
    """What the words ask for; ``all`` is every topic among the daemon's capabilities."""
    fields: dict[str, tuple[str, ...]] = {}
    for word in words:
        topic, _, field = word.partition(".")
        if word == EVERY:
            fields |= dict.fromkeys(_known_topics(capabilities), ())
        elif not field:
            fields[topic] = ()
        elif fields.get(topic) != ():
            fields[topic] = (*fields.get(topic, ()), field)
    return Selection(fields)


def _known_topics(capabilities: Iterable[str]) -> list[str]:
    return [name.removeprefix("topic.") for name in capabilities if name.startswith("topic.")]


def _value(topic: str, name: str, data: Mapping[str, Any]) -> Any:
    value: Any = data
    for key in name.split("."):
        inner = dict(enumerate(value)) if isinstance(value, list) else value
        members = {str(names): member for names, member in inner.items()} if isinstance(inner, dict) else {}
        if key not in members:
            names = ", ".join(members) or "nothing inside it"
            raise ProgramError(Exit.USAGE, f"{topic} has no field {name!r}: at {key!r} there is {names}")
        value = members[key]
    return value


PERIOD_S = 0.5


async def state_of(robot: Client) -> dict[str, Any]:
    """Everything that ``status`` shows, as the daemon tells it now."""
    hello = {"robot": robot.hello.robot, "protocol": robot.hello.protocol, "session": robot.hello.session}
    state = {**hello, **await robot.call("get_state"), "stats": await robot.call("get_stats")}
    if "method.list_plugins" in robot.hello.capabilities:
        state |= await robot.call("list_plugins")
    return state


async def follow(robot: Client, show: Callable[[Mapping[str, Any] | None, str], None]) -> None:
    """Show the latest state, and why there is none newer, until cancelled; ``robot`` connects again by itself."""
    latest: Mapping[str, Any] | None = None
    while True:
        try:
            latest, trouble = await state_of(robot), ""
        except ChefbotError as error:
            trouble = f"no answer: {error}"
        show(latest, trouble)
        await asyncio.sleep(PERIOD_S)


def _topics(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[str]:
    from chefbotd.client.models import (
        DATA_BY_TOPIC,
    )  # for shell completion only; the daemon knows which topics exist

    return [topic for topic in (*DATA_BY_TOPIC, EVERY) if topic.startswith(incomplete)]


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
    from chefbotd.cli.look.view import board

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
