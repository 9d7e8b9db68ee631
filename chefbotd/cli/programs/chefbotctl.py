"""The program chefbotctl: shows, drives and configures a robot whose daemon runs."""

from typing import TextIO

import click
from click.core import ParameterSource

from chefbotd import __version__
from chefbotd.cli.common.arguments import Address, address
from chefbotd.cli.common.context import CommandContext, CoroutineRunner, run_until_signalled
from chefbotd.cli.common.credentials import credentials
from chefbotd.cli.common.exits import MEANING, exit_table
from chefbotd.cli.drive import commands as driving
from chefbotd.cli.drive.commands import wheels
from chefbotd.cli.look import commands as looking
from chefbotd.cli.look.robots import address_of, robots
from chefbotd.cli.look.scan import scan
from chefbotd.cli.programs.program import CommandGroup, completion, example, wants_json
from chefbotd.component_list import components_with_commands

TOKEN = click.File(encoding="utf-8")

EXITS = list(MEANING)


@click.group(cls=CommandGroup, name="chefbotctl", epilog=exit_table(*EXITS))
@click.option(
    "--connect",
    "where",
    type=address,
    metavar="HOST:PORT",
    default="127.0.0.1:7333",
    show_default=True,
    envvar="CHEFBOTCTL_CONNECT",
    show_envvar=True,
    help="Where the daemon listens.",
)
@click.option(
    "--robot",
    "name",
    metavar="NAME",
    help="Instead of --connect: the robot of this name on the local network (see robots).",
)
@click.option(
    "--token-file",
    type=TOKEN,
    envvar="CHEFBOTCTL_TOKEN_FILE",
    show_envvar=True,
    help="A file with the token, alone or after its role.",
)
@click.option(
    "--ca",
    type=click.Path(exists=True, dir_okay=False),
    envvar="CHEFBOTCTL_CA",
    show_envvar=True,
    help="Speak TLS, and trust the certificates in this PEM file.",
)
@click.option(
    "--clear-token",
    is_flag=True,
    envvar="CHEFBOTCTL_CLEAR_TOKEN",
    show_envvar=True,
    help="Send the token to another computer without --ca, where others can read it.",
)
@click.version_option(__version__, prog_name="chefbotctl")
@click.pass_context
def main(
    ctx: click.Context,
    where: Address,
    name: str | None,
    token_file: TextIO | None,
    ca: str | None,
    *,
    clear_token: bool,
) -> None:
    """Watch, drive and configure a robot whose chefbotd is running."""
    run: CoroutineRunner = ctx.obj or run_until_signalled
    if name is not None:
        if ctx.get_parameter_source("where") is ParameterSource.COMMANDLINE:
            raise click.UsageError("--robot and --connect exclude each other: both say where the daemon is")
        where = address_of(name, run)
    ctx.obj = CommandContext(
        where, wants_json(ctx), run, credentials(token_file, ca, clear_token=clear_token)
    )


COMMANDS: tuple[click.Command, ...] = (
    looking.status,
    looking.watch,
    scan,
    looking.describe,
    robots,
    driving.drive,
    driving.teleop,
    driving.joystick,
    wheels,
    driving.square,
    driving.stop,
    driving.estop,
    driving.arm,
    example("serve", "serve"),
    driving.reset_odometry,
    driving.reset_board,
    completion,
)
"""The commands of the driving core; the others are those of components."""

for command in COMMANDS:
    main.add_command(command)
for component in components_with_commands():
    main.add_referenced(component.commands)
main.add_strangers()
main.add_late("chefbot_devtools.commands", "shell", "sweep")

if __name__ == "__main__":
    main()
