"""The commands whose code is in ``examples/``: a checkout of the sources has it, an installed package has not."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import click

from chefbotd.cli.common.exits import Exit, ProgramError


def example(name: str, make_target: str) -> click.Command:
    """The command of this name in ``examples/commands.py``.

    Where there is no such file, a command that says where it is, and that is not listed.
    """
    spec = find_spec("examples")
    folders = () if spec is None else spec.submodule_search_locations or ()
    if any((Path(folder) / "commands.py").exists() for folder in folders):
        command: click.Command = getattr(import_module("examples.commands"), name)
        return command
    return _absent(name, make_target)


def _absent(name: str, make_target: str) -> click.Command:
    @click.command(name, hidden=True, context_settings={"ignore_unknown_options": True})
    @click.argument("words", nargs=-1)
    @click.pass_context
    def command(ctx: click.Context, words: tuple[str, ...]) -> None:
        """Say where the demonstration is."""
        what = "is a demonstration, which only the sources of chefbotd have"
        raise ProgramError(
            Exit.NOT_INSTALLED, f"'{ctx.command_path}' {what}: run 'make {make_target}' in a checkout"
        )

    return command
