"""The command that lists the robots on the network, and the option that finds one by its name."""

import json
from collections.abc import Coroutine, Sequence
from typing import TYPE_CHECKING, Any

import click

from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.context import CommandContext, CoroutineRunner
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError, extra

if TYPE_CHECKING:
    from chefbotd.client.announcement import Announcement

SECONDS = click.FloatRange(0.1, 60.0)
NOBODY = (
    "No robot announces itself on this network. A robot does so with [discovery] enabled = true and a socket or page "
    "that others reach."
)


@click.command()
@click.option("--for", "seconds", type=SECONDS, default=5.0, show_default=True, help="How long to listen.")
@click.pass_obj
def robots(obj: CommandContext, seconds: float) -> None:
    """List the robots that announce themselves on this network."""
    with extra("discovery", "zeroconf", "ifaddr"):
        from chefbotd.client import discovery
    announcements = _run_listening(obj.run, discovery.robots(seconds))
    if obj.as_json:
        echo(json.dumps([_plain(robot) for robot in announcements]))
    elif not announcements:
        tell(NOBODY)
    else:
        echo("\n".join(_rows(announcements)))


def address_of(name: str, run: CoroutineRunner) -> Address:
    """Where the robot of this name listens.

    Raises:
        ProgramError: nobody answers to the name, or only the robot's own computer reaches its socket.
    """
    with extra("discovery", "zeroconf", "ifaddr"):
        from chefbotd.client import discovery
    announcement = _run_listening(run, discovery.find(name))
    if announcement is None or not announcement.addresses:
        raise ProgramError(
            Exit.CANNOT_CONNECT, f"no robot called {name!r} answers on this network: try chefbotctl robots"
        )
    if announcement.port is None:
        raise ProgramError(
            Exit.CANNOT_CONNECT,
            f"{name} has a page, but its socket accepts only clients on its own computer: set api.host there",
        )
    return Address(announcement.addresses[0], announcement.port)


def _run_listening(run: CoroutineRunner, listening: Coroutine[Any, Any, Any]) -> Any:
    try:
        return run(listening)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"cannot listen on this network: {error}") from error


def _plain(robot: "Announcement") -> dict[str, object]:
    return {
        "name": robot.name,
        "addresses": list(robot.addresses),
        "port": robot.port,
        "page": _page(robot),
        "robot": robot.robot,
        "version": robot.version,
        "tls": robot.encrypted,
    }


def _rows(announcements: "Sequence[Announcement]") -> list[str]:
    """A line for each robot; what it says of itself came over the network: nothing in it may move the cursor."""
    cells = [
        (
            robot.name,
            str(Address(robot.addresses[0], robot.port)) if robot.addresses and robot.port else "-",
            robot.robot,
            robot.version,
            _page(robot) or "-",
        )
        for robot in announcements
    ]
    head = ("NAME", "SOCKET", "ROBOT", "VERSION", "PAGE")
    table = [head, *[tuple(map(_printable, row)) for row in cells]]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in table]


def _printable(text: str) -> str:
    return "".join(character if character.isprintable() else "?" for character in text)


def _page(robot: "Announcement") -> str | None:
    scheme = "https" if robot.encrypted else "http"
    return None if robot.page_port is None else f"{scheme}://{robot.name}.local:{robot.page_port}/"
