"""The commands of chefbotctl about the wheels' controllers: show, set, undo, save, and tune on a screen."""

from pathlib import Path
from typing import Any

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import gain
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import need_terminal, tell
from chefbotd.cli.common.exits import Exit, ProgramError, extra

FILE = click.Path(exists=True, dir_okay=False, writable=True, path_type=Path)
UNSAVED = (
    "The gains were changed and not saved. 'chefbotctl pid save FILE' writes the present gains to a configuration. "
    "If the daemon has restarted, these commands set them again:"
)


@click.group(invoke_without_command=True)
@click.pass_context
def pid(ctx: click.Context) -> None:
    """Show, change, tune and save the wheels' gains.

    Without a command, show them.
    """
    if ctx.invoked_subcommand is None:
        ctx.invoke(get)


@pid.command("get")
@click.pass_obj
def get(context: CommandContext) -> None:
    """Show every wheel's gains."""
    output.gains(context.as_json, context.run_with_client(lambda robot: robot.call("get_pid"))["wheels"])


@pid.command("set")
@click.argument("wheel", metavar="WHEEL|all")
@click.argument("changes", nargs=-1, required=True, metavar="NAME=VALUE...", type=gain)
@click.pass_obj
def set_(context: CommandContext, wheel: str, changes: tuple[tuple[str, object], ...]) -> None:
    """Change gains of one WHEEL or of all while they run, such as: pid set all kp=420 ki=90."""
    gains: dict[str, Any] = dict(changes)
    if len(gains) < len(changes) or "wheel" in gains:
        raise click.UsageError("each gain may be named once, and the wheel comes before them")
    answer = context.run_with_client(lambda robot: robot.call("set_pid", wheel=wheel, **gains))
    output.gains(context.as_json, answer["wheels"])


@pid.command("undo")
@click.pass_obj
def undo(context: CommandContext) -> None:
    """Undo the latest change of gains, whoever made it."""
    output.gains(context.as_json, context.run_with_client(lambda robot: robot.call("undo_pid"))["wheels"])


@pid.command("save")
@click.argument("path", metavar="FILE", type=FILE)
@click.pass_obj
def save(context: CommandContext, path: Path) -> None:
    """Write the present gains into the configuration FILE, which keeps its comments.

    FILE is on this computer; the daemon reads its own when it starts.
    """
    with extra("tune", "tomlkit"):
        from chefbotd.components.tuning import gains_file
    from chefbotd.cli.programs.load import bad_configuration
    from chefbotd.settings import SettingsError

    gains = context.run_with_client(lambda robot: robot.get_pid())
    try:
        gains_file.save(path, gains)
    except SettingsError as error:
        raise bad_configuration(error) from error
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{path} was not written: {error.strerror}") from error
    output.say(context.as_json, {"saved": str(path)}, f"Saved to {path}.")


@pid.command("tune")
@click.option("--config", "path", metavar="FILE", type=FILE, help="The configuration that 's' saves to.")
@click.option(
    "--amplitude", "amplitude_m_s", metavar="M/S", type=click.FloatRange(0.01, 0.2), default=0.1,
    show_default=True, help="Speed of the excitation's square wave.",
)  # fmt: skip
@click.option(
    "--half-period", "half_period_s", metavar="S", type=click.FloatRange(0.5, 5.0), default=1.5,
    show_default=True, help="Duration of each direction.",
)  # fmt: skip
@click.pass_obj
def tune(context: CommandContext, path: Path | None, amplitude_m_s: float, half_period_s: float) -> None:
    """Tune on a screen: speed, target (grey), error and duty of each wheel while keys change the gains.

    The excitation drives the robot forward and back: put it on blocks first.
    """
    with extra("tune", "textual", "textual_plot", "textual_hires_canvas", "tomlkit"):
        from chefbotd.components.tuning.cli.tuning_screen import tune as run_screen
    from chefbotd.components.tuning.cli.excitation import Wave

    need_terminal()
    wave = Wave(amplitude_m_s=amplitude_m_s, half_period_s=half_period_s)
    context.run_with_client(lambda robot: run_screen(robot, str(context.address), path, wave, _tell_unsaved))


def _tell_unsaved(commands: list[str]) -> None:
    tell("\n".join([UNSAVED, *commands]))
