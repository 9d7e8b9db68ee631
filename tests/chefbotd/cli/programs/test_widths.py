"""What the programs print for a terminal is no wider than 100 columns, however wide the terminal is."""

from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from chefbotd.cli.common.echo import WIDEST
from chefbotd.cli.programs.chefbotctl import main as chefbotctl
from chefbotd.cli.programs.chefbotd import main as chefbotd


@pytest.mark.parametrize("program", [chefbotd, chefbotctl], ids=["chefbotd", "chefbotctl"])
def test_each_help_screen_fits_a_terminal(program: click.Group) -> None:
    """The help of each command, and of each below it, has no line of more than 100 columns on one of 200."""
    paths = list(_command_paths(program, ()))
    assert len(paths) > 10
    screens = [CliRunner(env={"COLUMNS": "200"}).invoke(program, [*path, "--help"]) for path in paths]
    assert [path for path, screen in zip(paths, screens, strict=True) if screen.exit_code] == []
    wide = [line for screen in screens for line in screen.output.splitlines() if len(line) > WIDEST]
    assert wide == []


def _command_paths(command: click.Command, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """The words that name this command, and those of each command below it."""
    yield path
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from _command_paths(inner, (*path, name))
