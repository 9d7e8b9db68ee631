"""The program chefbotd: run the daemon, run a simulated board, check a configuration.

Users wait for the start, so each command imports what it needs when it is called.
"""

import asyncio
import json
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd import __version__, start
from chefbotd.cli.common.arguments import PHYSICS, Address, address, configuration
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError, exit_table, require
from chefbotd.cli.programs.load import load_valid
from chefbotd.cli.programs.load import simulation as simulation_of
from chefbotd.cli.programs.program import CommandGroup, completion, wants_json
from chefbotd.component_list import own_components
from chefbotd.process import signals

if TYPE_CHECKING:
    from chefbotd.settings import Settings


@click.command()
@click.option(
    "--robot", default="chefbot", show_default=True, metavar="NAME", help="The packaged robot to copy."
)
@click.argument("folder", metavar="FOLDER", type=click.Path(file_okay=False, path_type=Path))
def init(robot: str, folder: Path) -> None:
    """Create the configuration of your own robot in FOLDER.

    Writes the packaged robot's configuration: what differs from the defaults, with comments. Nothing is overwritten.
    'chefbotctl new-robot' asks for your robot instead.
    """
    from chefbotd.settings import SettingsError, packaged

    try:
        source = packaged(robot)
    except SettingsError as error:
        raise click.UsageError(str(error)) from error
    config = folder / source.name
    text = source.read_text(encoding="utf-8")
    if config.exists():
        raise ProgramError(Exit.FAILED, f"{config}: already exists, and is not overwritten")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with config.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{error.filename}: cannot be written: {error.strerror}") from error
    echo(f"Wrote {config}: edit what differs on your robot.")
    echo(f"Then: chefbotd check-config {config}")
    echo(f"      chefbotd run --config {config}")


@click.command()
@click.argument("path", metavar="[FILE|ROBOT]", type=configuration, required=False)
def urdf(path: Path | None) -> None:
    """Print the robot's description (URDF).

    It is made from the configuration in FILE, or the packaged one of ROBOT; ChefBot's by default. It is what the daemon
    serves, unless [robot] description names a file of your own.
    """
    from chefbotd.settings.urdf import urdf_of

    echo(urdf_of(load_valid(path)).rstrip("\n"))


EXITS = (
    Exit.OK,
    Exit.FAILED,
    Exit.USAGE,
    Exit.NOT_DONE,
    Exit.BAD_CONFIGURATION,
    Exit.NOT_INSTALLED,
    Exit.INTERRUPTED,
    Exit.OUTPUT_CLOSED,
)
CYCLE_HZ = click.FloatRange(0.1, 1000.0)
SKETCHES = click.Choice(["tiva", "tiva_bare", "duemilanove", "tiva_second", "chefbot", "emulated"])
OWN_FIRMWARE = ("chefbot", "emulated")
SKETCH = "Which sketch the simulated board runs, instead of the configured one; chefbot: our own firmware."
WHICH_PHYSICS = "What moves the simulated robot, instead of what is configured; mujoco is an extra."
FILE_OR_ROBOT = "The robot's TOML file, or the name of a packaged one; ChefBot by default."


@click.group(cls=CommandGroup, name="chefbotd", epilog=exit_table(*EXITS))
@click.version_option(__version__, prog_name="chefbotd")
def main() -> None:
    """Drive a small wheeled robot over its serial board, and serve its command socket."""


@main.command()
@click.option("--config", "path", metavar="FILE|ROBOT", type=configuration, help=FILE_OR_ROBOT)
@click.option("--port", "device", metavar="DEV", help="The serial device, instead of the configured one.")
@click.option("--sim", "simulated", is_flag=True, help="Drive a simulated robot; no device is needed.")
@click.option("--sketch", type=SKETCHES, help=SKETCH)
@click.option("--physics", type=PHYSICS, help=WHICH_PHYSICS)
@click.option(
    "--listen", "where", type=address, metavar="HOST:PORT", help="Where to serve the command socket."
)
@click.option(
    "--page", "with_page", is_flag=True, help="Serve the page in the browser, as [page] enabled = true does."
)
@click.option(
    "--record",
    "with_recording",
    is_flag=True,
    help="Record from the start on, so that 'replay' can repeat it, as [recording] auto_start = true does.",
)
@click.option(
    "--foxglove", "with_foxglove", is_flag=True, help="Serve Foxglove, as [foxglove] enabled = true does."
)
@click.option(
    "--log-level", metavar="LEVEL", help="The lowest level that is logged: debug, info, warning, error."
)
@click.pass_context
def run(
    ctx: click.Context,
    path: Path | None,
    device: str | None,
    simulated: bool,
    sketch: str | None,
    physics: str | None,
    where: Address | None,
    with_page: bool,
    with_recording: bool,
    with_foxglove: bool,
    log_level: str | None,
) -> None:
    """Run the daemon until SIGINT or SIGTERM."""
    start.open_standard_streams()
    signals.hold_crashes()  # libraries start threads as they are imported
    _check_simulated(simulated, device, sketch, physics)
    overrides = _options_given(
        {
            "sim.board.sketch": sketch,
            "encoders.counted_by": _counted_by(sketch),
            "sim.physics": physics,
            "link.device": device,
            "api.host": where and where.host,
            "api.port": where and where.port,
            "page.enabled": with_page or None,
            "recording.enabled": with_recording or None,
            "recording.auto_start": with_recording or None,
            "foxglove.enabled": with_foxglove or None,
            "log.level": log_level,
        }
    )
    with start.light_imports():
        settings = load_valid(path, overrides)
        if simulated:
            simulation_of(settings)
        _require_extras(settings)
        from chefbotd.process import logs
        from chefbotd.process import run as process
        from chefbotd.settings import load

    logs.configure(settings.log.level)
    ctx.exit(
        process.run(
            settings, simulated=simulated, load=partial(load, path, overrides=overrides), config_file=path
        )
    )


def _counted_by(sketch: str | None) -> str | None:
    """A simulated board counts as is configured, and the daemon asks whose counts that are."""
    if sketch is None:
        return None
    return "firmware" if sketch in OWN_FIRMWARE else "sketch"


def _check_simulated(simulated: bool, device: str | None, sketch: str | None, physics: str | None) -> None:
    if simulated and device is not None:
        raise click.UsageError("--sim and --port exclude each other: a simulated board brings its own device")
    if sketch is not None and not simulated:
        raise click.UsageError("--sketch needs --sim: a real board runs its own")
    if physics is not None and not simulated:
        raise click.UsageError("--physics needs --sim: it moves a simulated robot")


def _options_given(options: Mapping[str, object]) -> dict[str, object]:
    """What was named on the command line."""
    return {key: value for key, value in options.items() if value is not None}


def _require_extras(settings: "Settings") -> None:
    """See that what the configuration wants is installed, before anything is begun."""
    if settings.page.enabled:
        require("page", "aiohttp", "websockets", "prometheus_client")
    for component in own_components():
        section = getattr(settings, component.name, None)
        extra = component.extra
        if extra is not None and component.is_enabled(section, settings) and extra.when(section):
            require(extra.name, *extra.packages)


@main.command()
@click.option("--config", "path", metavar="FILE|ROBOT", type=configuration, help=FILE_OR_ROBOT)
@click.option(
    "--link", type=click.Path(path_type=Path), help="A symbolic link to keep pointed at the device."
)
@click.option("--seed", type=click.IntRange(min=0), help="For the noise; the same seed, the same noise.")
@click.option("--sketch", type=SKETCHES, help=SKETCH)
@click.option("--physics", type=PHYSICS, help=WHICH_PHYSICS)
@click.option("--cycle-hz", type=CYCLE_HZ, metavar="HZ", help="How often the board reports, 0.1 to 1000.")
@click.pass_context
def simulate(
    ctx: click.Context,
    path: Path | None,
    link: Path | None,
    seed: int | None,
    sketch: str | None,
    physics: str | None,
    cycle_hz: float | None,
) -> None:
    """Run a simulated board, on a device of its own, and the robot's lidars, each on another.

    The board's path is the first line printed, the lidars' are the next. It obeys words on standard input, one a line:
    plug, unplug, truth, reset, quit.
    """
    cycle_s = None if cycle_hz is None else 1 / cycle_hz
    options = {"sim.board.sketch": sketch, "sim.board.cycle_s": cycle_s, "sim.physics": physics}
    settings = load_valid(path, _options_given(options))
    from chefbotd.components.simulation.simulate import simulate as run_board

    simulation = simulation_of(settings)
    try:
        asyncio.run(run_board(simulation, link_path=link, seed=seed, as_json=wants_json(ctx)))
    except (OSError, ValueError) as error:
        raise ProgramError(Exit.FAILED, str(error)) from error


@main.command()
@click.argument("path", metavar="[FILE|ROBOT]", type=configuration, required=False)
@click.option("--all", "shows_all", is_flag=True, help="Print every value, not only those that matter most.")
@click.pass_context
def check_config(ctx: click.Context, path: Path | None, shows_all: bool) -> None:
    """Check a configuration, and print what it resolves to: the ten lines that matter, or with --all every value.

    It is FILE, or the packaged one of ROBOT; ChefBot's by default. A configuration that is valid here is valid for
    'run' too. A URDF of your own ([robot] description) is compared with it, joint by joint: each wheel's radius,
    its place left or right of the middle, the direction of its axis, and where the sensors sit. Only what can be
    measured on the robot is compared: track_multiplier and the radius multipliers change nothing here. A robot that
    cannot be simulated is valid; a note says so.
    """
    settings = load_valid(path)
    try:
        simulation_of(settings)
    except ProgramError as problem:
        tell(f"Note: {problem}")
    from chefbotd.settings.notes import notes

    for stranger in settings.strangers:
        if stranger.component is None:
            tell(f"Note: the component {stranger.name} is left out: {stranger.reason}")
    for note in notes(settings):
        tell(f"Note: {note}")
    values = settings.model_dump(mode="json", by_alias=True)
    if wants_json(ctx):
        echo(json.dumps(values))
        return
    lines = list(_assignments("", values))
    if shows_all:
        echo("\n".join(lines))
        return
    from chefbotd.cli.programs.important import important_lines

    echo("\n".join(important_lines(settings)))
    where = "" if path is None else f" {path}"
    echo(f"It is valid. {len(lines)} values in all: chefbotd check-config{where} --all")


main.add_late("chefbotd.cli.programs.chefbotd", "init", "urdf")
main.add_late("chefbotd.components.recording.cli.replay", "replay")
main.add_late("chefbotd.cli.programs.new_component", "new-component", "new-plugin")
main.add_late("chefbotd.cli.programs.service", "install-service", "uninstall-service")
main.add_command(completion)


def _assignments(key: str, value: object) -> Iterator[str]:
    """``key = value`` for each value, with keys as dotted as the overrides' are."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _assignments(f"{key}.{name}" if key else name, inner)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for index, inner in enumerate(value):
            yield from _assignments(f"{key}.{inner.get('name', index)}", inner)
    else:
        yield f"{key} = {json.dumps(value, ensure_ascii=False)}"


if __name__ == "__main__":
    main()
