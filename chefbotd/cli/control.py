"""The program chefbotctl: asks, watches, drives and configures a running daemon."""

import click

from chefbotd import __version__
from chefbotd.cli import act, ask, move
from chefbotd.cli.arguments import Address, address
from chefbotd.cli.completion import completion
from chefbotd.cli.conversation import Conversation, Runner, run_until_signalled
from chefbotd.cli.exits import MEANING, Exit, Program, exit_table

EXITS = [code for code in MEANING if code is not Exit.BAD_CONFIGURATION]


@click.group(cls=Program, name="chefbotctl", epilog=exit_table(*EXITS))
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
@click.option("--json", "as_json", is_flag=True, help="Print JSON for scripts; failures too, on stderr.")
@click.version_option(__version__, prog_name="chefbotctl")
@click.pass_context
def main(ctx: click.Context, where: Address, as_json: bool) -> None:
    """Watch, drive and configure a robot whose chefbotd is running."""
    run: Runner = ctx.obj or run_until_signalled
    ctx.obj = Conversation(where, as_json, run)


COMMANDS: tuple[click.Command, ...] = (
    ask.status,
    ask.watch,
    ask.describe,
    move.drive,
    move.teleop,
    move.square,
    act.stop,
    act.estop,
    act.arm,
    act.pid,
    act.reset_odometry,
    act.reset_board,
    completion,
)

for command in COMMANDS:
    main.add_command(command)

if __name__ == "__main__":
    main()
