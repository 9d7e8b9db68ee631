"""The commands of chefbotctl that change something without driving: stop, arm, resets."""

import math
from collections.abc import Awaitable, Callable

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import Conversation
from chefbotd.cli.drive.pilot import told_of_stop
from chefbotd.client import Client


def _do(chat: Conversation, act: Callable[[Client], Awaitable[None]], said: str) -> None:
    chat.hold(act)
    output.say(chat.as_json, {"done": True}, said)


@click.command()
@click.pass_obj
def stop(chat: Conversation) -> None:
    """Stop the robot, whoever drives; who goes on driving is refused until it lets go for a second."""
    drivers = chat.hold(lambda robot: robot.stop())
    output.say(chat.as_json, {"done": True, "drivers": drivers}, told_of_stop(drivers))


@click.command()
@click.option("--reason", help="Why, for whoever arms the robot again.")
@click.pass_obj
def estop(chat: Conversation, reason: str | None) -> None:
    """Stop the robot at once and keep it stopped until 'arm'."""
    _do(chat, lambda robot: robot.estop(reason), "Stopped, and locked until 'chefbotctl arm'.")


@click.command()
@click.pass_obj
def arm(chat: Conversation) -> None:
    """Allow motion again after an emergency stop or a fault."""
    _do(chat, lambda robot: robot.arm(), "Armed: the robot may move.")


@click.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("x_m", metavar="[X]", type=finite, default=0.0)
@click.argument("y_m", metavar="[Y]", type=finite, default=0.0)
@click.argument("heading_deg", metavar="[DEG]", type=finite, default=0.0)
@click.pass_obj
def reset_odometry(chat: Conversation, x_m: float, y_m: float, heading_deg: float) -> None:
    """Say where the robot is; at the origin, if nothing is said.

    X and Y are in metres, DEG is the heading in degrees, counter-clockwise.
    """
    heading_rad = math.radians(heading_deg)
    said = f"Odometry starts from ({x_m:g} m, {y_m:g} m, {heading_deg:g}°)."
    _do(chat, lambda robot: robot.reset_odometry(x_m, y_m, heading_rad), said)


RESET_BEGUN = (
    "The board is asked to restart as soon as its motors stand; 'chefbotctl watch reset' tells how that goes, "
    "'chefbotctl arm' allows motion again."
)


@click.command()
@click.pass_obj
def reset_board(chat: Conversation) -> None:
    """Restart the robot's board; 'arm' comes after it."""
    _do(chat, lambda robot: robot.reset_board(), RESET_BEGUN)
