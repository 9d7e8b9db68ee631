"""The program chefbotd: run the daemon, check a configuration, and the commands of components.

Users wait for the start, so each command imports what it needs when it is called.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from chefbotd import __version__, start
from chefbotd.cli.common.arguments import Address, address, configuration
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError, exit_table, require
from chefbotd.cli.programs.load import load_valid
from chefbotd.cli.programs.program import CommandGroup, completion, wants_json
from chefbotd.component import Hardware, resolve
from chefbotd.component_list import own_components
from chefbotd.process import signals

if TYPE_CHECKING:
    from chefbotd.settings import Settings

Function: TypeAlias = Callable[..., Any]


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
HARDWARE = [component.hardware for component in own_components() if component.hardware is not None]
OPTIONS = [option for component in own_components() for option in component.run_options]
FILE_OR_ROBOT = "The robot's TOML file, or the name of a packaged one; ChefBot by default."


@click.group(cls=CommandGroup, name="chefbotd", epilog=exit_table(*EXITS))
@click.version_option(__version__, prog_name="chefbotd")
def main() -> None:
    """Drive a small wheeled robot over its serial board, and serve its command socket."""


def with_component_options(command: Function) -> Function:
    """The command with the options of components, in the order of their list."""
    for option in reversed(OPTIONS):
        kind: dict[str, Any] = {"type": click.Choice(option.choices)} if option.choices else {"is_flag": True}
        command = click.option(option.name, help=option.help, **kind)(command)
    for hardware in reversed(HARDWARE):
        command = click.option(hardware.option, is_flag=True, help=hardware.help)(command)
    return command


@main.command()
@click.option("--config", "path", metavar="FILE|ROBOT", type=configuration, help=FILE_OR_ROBOT)
@click.option("--port", "device", metavar="DEV", help="The serial device, instead of the configured one.")
@click.option(
    "--listen", "where", type=address, metavar="HOST:PORT", help="Where to serve the command socket."
)
@click.option(
    "--page", "with_page", is_flag=True, help="Serve the page in the browser, as [page] enabled = true does."
)
@with_component_options
@click.option(
    "--log-level", metavar="LEVEL", help="The lowest level that is logged: debug, info, warning, error."
)
@click.pass_context
def run(
    ctx: click.Context,
    /,
    path: Path | None,
    device: str | None,
    where: Address | None,
    with_page: bool,
    log_level: str | None,
    **given: Any,
) -> None:
    """Run the daemon until SIGINT or SIGTERM."""
    start.open_standard_streams()
    signals.hold_crashes()  # libraries start threads as they are imported
    hardware = next((hardware for hardware in HARDWARE if given[_parameter(hardware.option)]), None)
    _check_simulated(hardware, device, given)
    overrides = {
        **_options_given(
            {
                "link.device": device,
                "api.host": where and where.host,
                "api.port": where and where.port,
                "page.enabled": with_page or None,
                "log.level": log_level,
            }
        ),
        **_keys_of_options(given),
    }
    with start.light_imports():
        settings = load_valid(path, overrides)
        if hardware is not None:
            resolve(hardware.check)(settings)
        _require_extras(settings)
        from chefbotd.process import logs
        from chefbotd.process import run as process
        from chefbotd.settings import load

    logs.configure(settings.log.level)
    ctx.exit(
        process.run(
            settings, hardware=hardware, load=partial(load, path, overrides=overrides), config_file=path
        )
    )


def _check_simulated(hardware: Hardware | None, device: str | None, given: Mapping[str, Any]) -> None:
    if hardware is not None and device is not None:
        raise click.UsageError(
            f"{hardware.option} and --port exclude each other: a simulated board brings its own device"
        )
    for option in OPTIONS:
        if option.needs_simulated and hardware is None and given[_parameter(option.name)]:
            needed = " or ".join(hardware.option for hardware in HARDWARE)
            raise click.UsageError(f"{option.name} needs {needed}: {option.needs_simulated}")


def _keys_of_options(given: Mapping[str, Any]) -> dict[str, object]:
    """What the options of components set, where they were given."""
    keys: dict[str, object] = {}
    for option in OPTIONS:
        if value := given[_parameter(option.name)]:
            keys |= option.keys(value)
    return keys


def _parameter(option: str) -> str:
    """How click names the parameter of an option."""
    return option.removeprefix("--").replace("-", "_")


def _options_given(options: Mapping[str, object]) -> dict[str, object]:
    """What was named on the command line."""
    return {key: value for key, value in options.items() if value is not None}


def _require_extras(settings: "Settings") -> None:
    """See that what the configuration wants is installed, before anything is begun."""
    if settings.page.enabled:
        require("page", "aiohttp", "websockets", "prometheus_client")
    for component in own_components():
        section = getattr(settings, component.key, None)
        extra = component.extra
        if extra is not None and component.is_enabled(section, settings) and extra.when(section):
            require(extra.name, *extra.packages)


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
    for hardware in HARDWARE:
        try:
            resolve(hardware.check)(settings)
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
    echo(f"It is valid. {len(lines)} values in all: chefbotd check-config{_as_argument(path)} --all")


def _as_argument(path: Path | None) -> str:
    """How a configuration is named behind a command: a packaged one by its robot, however long its path is."""
    if path is None:
        return ""
    from chefbotd.settings import packaged

    return f" {path.stem if path.parent == packaged().parent else path}"


main.add_late("chefbotd.cli.programs.chefbotd", "init", "urdf")
for component in own_components():
    main.add_referenced(component.daemon_commands)
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
