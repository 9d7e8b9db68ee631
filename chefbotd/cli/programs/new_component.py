"""The commands that begin a package with a component: one folder, its test and its README; or a plug-in, of one file."""

import re
import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from string import Template

import click

from chefbotd import __version__
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.component import API_VERSION
from chefbotd.extras import how_to_add_folder, pytest_of

TEMPLATES = files("chefbotd.cli.programs")
NAME = re.compile(r"[a-z][a-z0-9_]{0,40}")

COMPONENT = {
    "pyproject.toml.in": "pyproject.toml",
    "README.md.in": "README.md",
    "component.py.in": "chefbot_{name}/__init__.py",
    "service.py.in": "chefbot_{name}/service.py",
    "commands.py.in": "chefbot_{name}/commands.py",
    "card.js.in": "chefbot_{name}/card.js",
    "test_component.py.in": "test_chefbot_{name}.py",
}
PLUGIN = {
    "pyproject.toml.in": "pyproject.toml",
    "README.md.in": "README.md",
    "plugin.py.in": "chefbot_{name}.py",
    "test_plugin.py.in": "test_chefbot_{name}.py",
}

INTO = click.option(
    "--into",
    "folder",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="The folder to make; chefbot-NAME by default.",
)


@click.command()
@click.argument("name", metavar="NAME")
@INTO
def new_component(name: str, folder: Path | None) -> None:
    """Begin a component NAME: a package with a section of the configuration and all that it does.

    It adds a method, a topic, a command of chefbotctl, a row of its status and a card on the page, and works as it
    stands, with its test. Nothing is overwritten.
    """
    _begin(name, folder, "component", COMPONENT)


@click.command()
@click.argument("name", metavar="NAME")
@INTO
def new_plugin(name: str, folder: Path | None) -> None:
    """Begin a plug-in NAME: a package that adds methods and topics to the daemon.

    Writes a package that works as it stands, with its test. Nothing is overwritten. See also new-component.
    """
    _begin(name, folder, "plugin", PLUGIN)


def _begin(name: str, folder: Path | None, kind: str, written: Mapping[str, str]) -> None:
    if not NAME.fullmatch(name):
        what = "plug-in" if kind == "plugin" else kind
        raise click.UsageError(
            f"{name!r}: a {what}'s name is a small letter, then small letters, digits and underscores, at most 41"
        )
    command = name.replace("_", "-")
    folder = folder or Path(f"chefbot-{command}")
    values = {
        "name": name,
        "command": command,
        "title": name.replace("_", " ").capitalize(),
        "package": f"chefbot-{command}",
        "class_name": "".join(word.capitalize() for word in name.split("_")),
        "api": str(API_VERSION),
        "version": __version__,
    }
    try:
        folder.mkdir(parents=True)
        for template, target in written.items():
            source = TEMPLATES / f"{kind}_template" / template
            path = folder / target.format(name=name)
            path.parent.mkdir(exist_ok=True)
            path.write_text(Template(source.read_text(encoding="utf-8")).substitute(values), encoding="utf-8")
    except FileExistsError as error:
        raise ProgramError(Exit.FAILED, f"{folder}: already exists, and is not overwritten") from error
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{error.filename}: cannot be written: {error.strerror}") from error
    echo(f"Wrote {folder}.")
    as_path = folder if folder.is_absolute() else f"./{folder}"  # a name alone would be asked of the index
    echo(f"Then: {how_to_add_folder(f'{as_path}[test]', editable=True)}")
    echo(f"      {pytest_of(Path(sys.prefix))} {as_path}")
    echo(f'and in the robot\'s configuration: [plugins] allow = ["{name}"]')
