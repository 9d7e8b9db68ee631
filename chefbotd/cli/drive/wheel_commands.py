"""The command of chefbotctl that turns single wheels."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click
from msgspec import to_builtins

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import positive, wheel_speed
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.take_control import run_as_driver, take_over
from chefbotd.client import Client

if TYPE_CHECKING:
    from chefbotd.cli.drive.timed_drive import Turning

SUFFIX = "_wheel"
"""The suffix that may be left out of a wheel's name."""


@click.command()
@click.argument("asked", metavar="NAME=RAD_S...", type=wheel_speed, nargs=-1, required=True)
@click.option("--for", "seconds", metavar="S", type=positive, required=True, help="For S seconds.")
@take_over
@click.pass_obj
def wheels(
    context: CommandContext, asked: tuple[tuple[str, float], ...], seconds: float, takes_over: bool
) -> None:
    """Turn wheels each at RAD_S rad/s, for S seconds.

    NAME is a wheel's name, such as left_wheel, or left for short. Forward is positive; wheels that are not named stand.
    It always ends with a stop. A speed beyond the robot's limits is reduced, with a message. Exit code 6 means that
    a wheel turned far less than the limits allow.
    """
    from rich.console import Console

    from chefbotd.cli.drive.timed_drive import turn_for

    if len(dict(asked)) < len(asked):
        raise click.UsageError("each wheel may be named once")
    wanted: dict[str, float] = {}

    async def turn(robot: Client) -> "Turning":
        wanted.update(_by_wheel(asked, list(await robot.get_pid())))
        return await turn_for(robot, wanted, seconds, report)

    with output.countdown(seconds, Console(stderr=True, quiet=context.as_json)) as report:
        done = run_as_driver(context, "wheels", turn, takes_over=takes_over)
    allowed = ", ".join(f"{name} {speed:+.2f} rad/s" for name, speed in done.allowed_rad_s.items())
    turned = ", ".join(f"{name} {done.turned_rad_s.get(name, 0.0):+.2f} rad/s" for name in wanted)
    output.say(
        context.as_json,
        {
            "velocity_rad_s": done.turned_rad_s,
            "happened": not done.stuck,
            "allowed_rad_s": done.allowed_rad_s,
            **to_builtins(done.told),
        },
        f"{done.told.limit_line(allowed)}Turned at the end: {turned}",
    )
    if done.stuck:
        names = ", ".join(done.stuck)
        raise ProgramError(
            Exit.NOT_DONE,
            f"these wheels were told to turn, but hardly turned: {names}{done.told.limit_suffix}",
        )


def _by_wheel(asked: Iterable[tuple[str, float]], wheels: Iterable[str]) -> dict[str, float]:
    """The speeds by the wheels' full names; an unknown name is passed on, and the daemon refuses it."""
    short = {wheel.removesuffix(SUFFIX): wheel for wheel in wheels}
    found: dict[str, float] = {}
    for name, speed in asked:
        wheel = short.get(name.removesuffix(SUFFIX), name)
        if wheel in found:
            raise click.UsageError(f"each wheel may be named once, and {name} is {wheel} too")
        found[wheel] = speed
    return found
