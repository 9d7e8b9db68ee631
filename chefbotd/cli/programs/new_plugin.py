"""The command that begins a plug-in: a package with a feature, its test and its README."""

import re
import sys
from importlib.resources import files
from pathlib import Path
from string import Template

import click

from chefbotd import __version__
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.extras import how_to_add_folder
from chefbotd.features.plugin import API_VERSION

TEMPLATES = files("chefbotd.cli.programs") / "plugin_template"
NAME = re.compile(r"[a-z][a-z0-9_]{0,40}")

WRITTEN = {
    "pyproject.toml.in": "pyproject.toml",
    "README.md.in": "README.md",
    "plugin.py.in": "chefbot_{name}.py",
    "test_plugin.py.in": "test_chefbot_{name}.py",
}


@click.command()
@click.argument("name", metavar="NAME")
@click.option(
    "--into",
    "folder",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="The folder to make; chefbot-NAME by default.",
)
def new_plugin(name: str, folder: Path | None) -> None:
    """Begin a plug-in NAME: a package that adds methods and topics to the daemon.

    Writes a package that works as it stands, with its test. Nothing is overwritten.
    """
    if not NAME.fullmatch(name):
        raise click.UsageError(
            f"{name!r}: a plug-in's name is a small letter, then small letters, digits and underscores, at most 41"
        )
    folder = folder or Path(f"chefbot-{name.replace('_', '-')}")
    values = {
        "name": name,
        "package": f"chefbot-{name.replace('_', '-')}",
        "class_name": "".join(word.capitalize() for word in name.split("_")),
        "api": str(API_VERSION),
        "version": __version__,
    }
    try:
        folder.mkdir(parents=True)
        for template, target in WRITTEN.items():
            text = Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(values)
            (folder / target.format(name=name)).write_text(text, encoding="utf-8")
    except FileExistsError as error:
        raise ProgramError(Exit.FAILED, f"{folder}: already exists, and is not overwritten") from error
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{error.filename}: cannot be written: {error.strerror}") from error
    echo(f"Wrote {folder}.")
    echo(f"Then: {how_to_add_folder(str(folder), editable=True)}")
    echo(f"      {Path(sys.prefix, 'bin', 'pytest')} {folder}")
    echo(f'and in the robot\'s configuration: [plugins] allow = ["{name}"]')
