"""Giving a robot back, and what is said after a stop."""

import contextlib
from collections.abc import Mapping

from chefbotd.client import CallError, Client


async def arm_seen(robot: Client) -> None:
    """Clear what has latched by now; what latches while this is on its way holds."""
    await robot.arm((await robot.get_state()).safety.latch)


async def release_source(robot: Client, source: str | None = None) -> None:
    """Set our own target to zero, then release our sources. If the release is refused, send a stop, which never is."""
    with contextlib.suppress(
        CallError
    ):  # disarmed, or another client has control: our command does not move the robot
        await robot.drive(0.0, 0.0, source)
    try:
        await robot.release_control()
    except CallError:
        await robot.stop()


def describe_stop(drivers: Mapping[str, str]) -> str:
    """The message after a stop, with who was driving."""
    if not drivers:
        return "Stopped; nobody was driving."
    who = ", ".join(f"{source} was driven by {client}" for source, client in drivers.items())
    return f"Stopped; {who}. Other drivers are refused until they release the robot."
