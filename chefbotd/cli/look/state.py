"""What ``status`` shows, once or again and again."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from chefbotd.client import ChefbotError, Client

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
