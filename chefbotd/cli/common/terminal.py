"""The check that a screen has a terminal."""

import sys

from chefbotd.cli.common.exits import Exit, ProgramError


def need_terminal() -> None:
    """Check that there is a terminal (Textual reads stdin and draws on stderr).

    Raises:
        ProgramError: stdin, stdout or stderr is a file or a pipe.
    """
    streams = {"standard input": sys.stdin, "standard output": sys.stdout, "standard error": sys.stderr}
    elsewhere = [name for name, stream in streams.items() if not stream.isatty()]
    if elsewhere:
        raise ProgramError(Exit.USAGE, f"this needs a terminal, but there is none on {', '.join(elsewhere)}")
