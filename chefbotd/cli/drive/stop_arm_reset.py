"""The commands of chefbotctl that stop, arm and reset."""

import math
from collections.abc import Awaitable, Callable

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.drive.control import arm_seen, describe_stop
from chefbotd.client import Client


def _do(context: CommandContext, act: Callable[[Client], Awaitable[None]], said: str) -> None:
    context.run_with_client(act)
    output.say(context.as_json, {"done": True}, said)


@click.command()
@click.pass_obj
def stop(context: CommandContext) -> None:
    """Stop the robot, whoever drives; a driver is refused until it pauses for a second."""
    drivers = context.run_with_client(lambda robot: robot.stop())
    output.say(context.as_json, {"done": True, "drivers": drivers}, describe_stop(drivers))


@click.command()
@click.option("--reason", help="Why, for whoever arms the robot again.")
@click.pass_obj
def estop(context: CommandContext, reason: str | None) -> None:
    """Stop the robot at once and keep it stopped until 'arm'."""
    _do(context, lambda robot: robot.estop(reason), "Stopped, and locked until 'chefbotctl arm'.")


@click.command()
@click.pass_obj
def arm(context: CommandContext) -> None:
    """Allow motion again after an emergency stop or a fault.

    Only after what has latched when the command begins: a stop that comes after it holds.
    """
    _do(context, arm_seen, "Armed: the robot may move.")


@click.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("x_m", metavar="[X]", type=finite, default=0.0)
@click.argument("y_m", metavar="[Y]", type=finite, default=0.0)
@click.argument("heading_deg", metavar="[DEG]", type=finite, default=0.0)
@click.pass_obj
def reset_odometry(context: CommandContext, x_m: float, y_m: float, heading_deg: float) -> None:
    """Set the robot's pose in odometry; default: the origin.

    X and Y are in metres, DEG is the heading in degrees, counter-clockwise.
    """
    heading_rad = math.radians(heading_deg)
    said = f"Odometry starts from ({x_m:g} m, {y_m:g} m, {heading_deg:g}°)."
    _do(context, lambda robot: robot.reset_odometry(x_m, y_m, heading_rad), said)


RESET_BEGUN = (
    "The board will restart as soon as its motors stand. 'chefbotctl watch reset' shows the progress; "
    "'chefbotctl arm' allows motion again."
)


@click.command()
@click.pass_obj
def reset_board(context: CommandContext) -> None:
    """Restart the robot's board. Send 'arm' afterwards."""
    _do(context, lambda robot: robot.reset_board(), RESET_BEGUN)
