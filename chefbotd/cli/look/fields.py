"""Selects what ``watch`` prints of an event: a topic, or fields such as ``odometry.x_m`` or ``wheels.duty.0``."""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import ChefbotError, Client

EVERY = "all"


@dataclass(frozen=True, slots=True)
class Selection:
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
        wanted = self.fields[topic]
        return {name: _value(topic, name, data) for name in wanted} if wanted else dict(data)


def select(words: Iterable[str], capabilities: Iterable[str]) -> Selection:
    """What the words ask for; ``all`` is every topic among the daemon's capabilities."""
    fields: dict[str, tuple[str, ...]] = {}
    for word in words:
        topic, _, field = word.partition(".")
        if word == EVERY:
            fields |= dict.fromkeys(_topics(capabilities), ())
        elif not field:
            fields[topic] = ()
        elif fields.get(topic) != ():
            fields[topic] = (*fields.get(topic, ()), field)
    return Selection(fields)


def _topics(capabilities: Iterable[str]) -> list[str]:
    return [name.removeprefix("topic.") for name in capabilities if name.startswith("topic.")]


def _value(topic: str, name: str, data: Mapping[str, Any]) -> Any:
    value: Any = data
    for key in name.split("."):
        inner = dict(enumerate(value)) if isinstance(value, list) else value
        found = {str(known): member for known, member in inner.items()} if isinstance(inner, dict) else {}
        if key not in found:
            known = ", ".join(found) or "nothing inside it"
            raise ProgramError(Exit.USAGE, f"{topic} has no field {name!r}: at {key!r} there is {known}")
        value = found[key]
    return value


PERIOD_S = 0.5


async def state_of(robot: Client) -> dict[str, Any]:
    """Everything that ``status`` shows, as the daemon tells it now."""
    hello = {"robot": robot.hello.robot, "protocol": robot.hello.protocol, "session": robot.hello.session}
    return {**hello, **await robot.call("get_state"), "stats": await robot.call("get_stats")}


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
