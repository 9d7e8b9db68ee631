"""The program chefbotctl: shows, drives and configures a robot whose daemon runs."""

import ssl
from typing import TextIO

import click
from click.core import ParameterSource

from chefbotd import __version__
from chefbotd.cli.calibrate.commands import calibrate
from chefbotd.cli.common.arguments import Address, address
from chefbotd.cli.common.context import CommandContext, CoroutineRunner, Credentials, run_until_signalled
from chefbotd.cli.common.exits import MEANING, exit_table
from chefbotd.cli.doctor.doctor_command import doctor, ports
from chefbotd.cli.drive import commands as driving
from chefbotd.cli.drive.commands import wheels
from chefbotd.cli.flash.command import flash
from chefbotd.cli.look import commands as looking
from chefbotd.cli.look.robots import address_of, robots
from chefbotd.cli.look.scan import scan
from chefbotd.cli.maps.commands import map_group
from chefbotd.cli.maps.places import places
from chefbotd.cli.navigate import commands as navigating
from chefbotd.cli.programs.program import CommandGroup, completion, example, wants_json
from chefbotd.cli.record.commands import log_group, record
from chefbotd.cli.tune.commands import pid

TOKEN = click.File(encoding="utf-8")
LONGEST_TOKEN = 512
"""The daemon's limit."""

LONGEST_TOKEN_FILE = 65_536
ROLES = ("observe", "guest", "agent", "drive", "admin")
"""The daemon's roles, repeated here so that chefbotctl need not import them."""

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
        where, wants_json(ctx), run, _credentials(token_file, ca, clear_token=clear_token)
    )


def _credentials(token_file: TextIO | None, ca: str | None, *, clear_token: bool) -> Credentials:
    token = None if token_file is None else _token(token_file)
    try:
        return Credentials(token, None if ca is None else ssl.create_default_context(cafile=ca), clear_token)
    except OSError as error:
        raise click.UsageError(f"--ca {ca}: no certificates: {error}") from error


def _token(file: TextIO) -> str:
    """The first token in the file: alone on its line or after its role, as in the daemon's own file.

    The token never appears in a message.
    """
    try:
        lines = file.read(LONGEST_TOKEN_FILE + 1).splitlines()
    except UnicodeDecodeError:
        raise click.UsageError(f"--token-file {file.name}: is not text") from None
    entries = [line.split() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    words = entries[0] if entries else []
    has_role = len(words) == 2 and words[0] in ROLES
    if not (len(words) == 1 or has_role) or len(words[-1]) > LONGEST_TOKEN:
        raise click.UsageError(
            f"--token-file {file.name}: expected a token of at most {LONGEST_TOKEN} characters, alone or after its "
            f"role ({', '.join(ROLES)}), found {len(words)} words"
        )
    return words[-1]


map_group.add_command(example("demo", "map"))

COMMANDS: tuple[click.Command, ...] = (
    looking.status,
    looking.watch,
    scan,
    looking.describe,
    robots,
    doctor,
    ports,
    flash,
    driving.drive,
    driving.teleop,
    driving.joystick,
    wheels,
    driving.square,
    driving.stop,
    driving.estop,
    driving.arm,
    pid,
    calibrate,
    map_group,
    places,
    *navigating.COMMANDS,
    example("serve", "serve"),
    record,
    log_group,
    driving.reset_odometry,
    driving.reset_board,
    completion,
)

for command in COMMANDS:
    main.add_command(command)
main.add_late("chefbot_devtools.commands", "shell", "sweep")

if __name__ == "__main__":
    main()
