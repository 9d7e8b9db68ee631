"""What a user shows a daemon, and whom the user trusts: a file with a token, and one with certificates."""

import ssl
from typing import TextIO

import click

from chefbotd.cli.common.context import Credentials

LONGEST_TOKEN = 512
"""The daemon's limit."""

LONGEST_TOKEN_FILE = 65_536
ROLES = ("observe", "guest", "agent", "drive", "admin")
"""The daemon's roles, repeated here so that chefbotctl need not import them."""


def credentials(token_file: TextIO | None, ca: str | None, *, clear_token: bool) -> Credentials:
    """The token of a file, and the certificates to trust; raises ``click.UsageError`` where one is none."""
    token = None if token_file is None else _token(token_file)
    try:
        return Credentials(token, None if ca is None else ssl.create_default_context(cafile=ca), clear_token)
    except OSError as error:
        raise click.UsageError(f"--ca {ca}: no certificates: {error}") from error


def _token(file: TextIO) -> str:
    """The first token in the file: alone on its line or after its role, as in the daemon's own file.

    The token never appears in a message.
    """
    try:
        lines = file.read(LONGEST_TOKEN_FILE + 1).splitlines()
    except UnicodeDecodeError:
        raise click.UsageError(f"--token-file {file.name}: is not text") from None
    entries = [line.split() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    words = entries[0] if entries else []
    has_role = len(words) == 2 and words[0] in ROLES
    if not (len(words) == 1 or has_role) or len(words[-1]) > LONGEST_TOKEN:
        raise click.UsageError(
            f"--token-file {file.name}: expected a token of at most {LONGEST_TOKEN} characters, alone or after its "
            f"role ({', '.join(ROLES)}), found {len(words)} words"
        )
    return words[-1]
