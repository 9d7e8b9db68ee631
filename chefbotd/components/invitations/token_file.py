"""The command ``chefbotctl token``: tokens for the daemon's token file, on the robot's computer."""

import secrets
from pathlib import Path

import click

from chefbotd.cli.common.credentials import ROLES
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.rpc.access import MAX_FILE_BYTES, AccessError, Keyring
from chefbotd.storage import explain, lock, read_file, replace_file

TOKEN_BYTES = 32
PRIVATE = 0o600
"""Whoever reads a token may drive the robot."""


@click.group()
def token() -> None:
    """Make tokens for the daemon's token file."""


@token.command("new")
@click.argument("role", type=click.Choice(ROLES))
@click.option("--file", "path", type=click.Path(dir_okay=False, path_type=Path), help="Add it to this file.")
def new(role: str, path: Path | None) -> None:
    """Print a line for the token file, with a new token; with --file, add it to that file.

    The daemon reads the file at its start and when it reloads its configuration.
    """
    line = f"{role} {secrets.token_hex(TOKEN_BYTES)}"
    if path is not None:
        add_line(path, line)
    echo(line)


def add_line(path: Path, line: str) -> None:
    """Add a line to a token file, which only its owner can read; one that is none stays as it is.

    Its folder is locked meanwhile: of two lines that are added in the same moment none is lost.

    Raises:
        ProgramError: it cannot be read or written, or is no token file.
    """
    try:
        file = path.resolve()  # a link stays one
        with lock(file.parent):
            before = read_file(file, MAX_FILE_BYTES).decode() if file.exists() else ""
            if before.strip():
                Keyring.parse(before, str(path))
            text = f"{before.rstrip()}\n{line}\n".lstrip()
            replace_file(file, text.encode(), PRIVATE)
    except AccessError as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
    except UnicodeDecodeError:
        raise ProgramError(Exit.FAILED, f"{path}: is not UTF-8 text") from None
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{path}: {explain(error)}") from error
