"""The commands of chefbotd for your own robot: create its configuration, print its description."""

from pathlib import Path

import click

from chefbotd.cli.common.arguments import configuration
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.load import load_valid


@click.command()
@click.option(
    "--robot", default="chefbot", show_default=True, metavar="NAME", help="The packaged robot to copy."
)
@click.argument("folder", metavar="FOLDER", type=click.Path(file_okay=False, path_type=Path))
def init(robot: str, folder: Path) -> None:
    """Create the configuration of your own robot in FOLDER.

    Writes the packaged robot's configuration with all its comments, and its description (URDF), which is made from the
    configuration. Nothing is overwritten.
    """
    from chefbotd.settings import SettingsError, packaged
    from chefbotd.settings.urdf import urdf_of

    try:
        source = packaged(robot)
    except SettingsError as error:
        raise click.UsageError(str(error)) from error
    config, urdf = folder / source.name, folder / f"{source.stem}.urdf"
    texts = {config: source.read_text(encoding="utf-8"), urdf: urdf_of(load_valid(source))}
    if existing := [str(path) for path in texts if path.exists()]:
        raise ProgramError(Exit.FAILED, f"{', '.join(existing)}: already exists, and is not overwritten")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, text in texts.items():
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{error.filename}: cannot be written: {error.strerror}") from error
    echo(f"Wrote {config}: edit what differs on your robot.")
    echo(f"Wrote {urdf}: its links and joints, made from the configuration.")
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
