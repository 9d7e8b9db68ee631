"""The command of chefbotctl that turns wheels each on its own."""

from dataclasses import asdict

import click

from chefbotd.cli import output
from chefbotd.cli.arguments import positive, wheel_speed
from chefbotd.cli.conversation import Conversation
from chefbotd.cli.exits import Exit, ProgramError
from chefbotd.cli.lead import lead, take_over


@click.command()
@click.argument("asked", metavar="NAME=RAD_S...", type=wheel_speed, nargs=-1, required=True)
@click.option("--for", "seconds", metavar="S", type=positive, required=True, help="For S seconds.")
@take_over
@click.pass_obj
def wheels(
    chat: Conversation, asked: tuple[tuple[str, float], ...], seconds: float, takes_over: bool
) -> None:
    """Turn wheels each at RAD_S rad/s, for S seconds.

    Forward is positive; wheels that are not named stand. It always ends with a stop. What is beyond the robot's
    limits is slowed, and told. Exit code 6 means that a wheel was told to turn and turned next to nothing of what
    the limits allow.
    """
    from rich.console import Console

    from chefbotd.cli.timed_drive import turn_for

    wanted = dict(asked)
    if len(wanted) < len(asked):
        raise click.UsageError("each wheel may be named once")
    with output.countdown(seconds, Console(stderr=True, quiet=chat.as_json)) as report:
        done = lead(
            chat, "wheels", lambda robot: turn_for(robot, wanted, seconds, report), takes_over=takes_over
        )
    allowed = ", ".join(f"{name} {speed:+.2f} rad/s" for name, speed in done.allowed_rad_s.items())
    turned = ", ".join(f"{name} {done.turned_rad_s.get(name, 0.0):+.2f} rad/s" for name in wanted)
    output.say(
        chat.as_json,
        {
            "velocity_rad_s": done.turned_rad_s,
            "happened": not done.stuck,
            "allowed_rad_s": done.allowed_rad_s,
            **asdict(done.told),
        },
        f"{done.told.clipped(allowed)}Turned at the end: {turned}",
    )
    if done.stuck:
        names = ", ".join(done.stuck)
        raise ProgramError(
            Exit.NOT_DONE, f"told to turn, and seen to turn next to nothing: {names}{done.told.because}"
        )
