"""Printing on standard output, with an exit code for a full disk and for closed output."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

from chefbotd.cli.common.exits import Exit, ProgramError


@contextmanager
def writing() -> Iterator[None]:
    """Turn a failure to print in this block into a ``ProgramError``.

    Raises:
        ProgramError: the output could not be written; ``OUTPUT_CLOSED`` when the reader closed it, as ``head`` does.
    """
    try:
        yield
    except OSError as error:
        _discard_buffered_output()
        code = Exit.OUTPUT_CLOSED if isinstance(error, BrokenPipeError) else Exit.FAILED
        raise ProgramError(code, f"cannot write the output: {error.strerror}") from error


def _discard_buffered_output() -> None:
    """Discard buffered output, which would otherwise fail again when the interpreter ends."""
    void = os.open(os.devnull, os.O_WRONLY)
    os.dup2(void, sys.stdout.fileno())
    os.close(void)


def plain(text: str) -> str:
    """The text without what a terminal would take for a command: somebody else may have written it."""
    return re.sub("[\x00-\x08\x0b-\x1f\x7f-\x9f]", "\N{REPLACEMENT CHARACTER}", text)


def echo(text: str) -> None:
    """Print a line; raises as ``writing`` does."""
    with writing():
        click.echo(text)


def need_terminal() -> None:
    """Check that there is a terminal (Textual reads stdin and draws on stderr).

    Raises:
        ProgramError: stdin, stdout or stderr is a file or a pipe.
    """
    streams = {"standard input": sys.stdin, "standard output": sys.stdout, "standard error": sys.stderr}
    elsewhere = [name for name, stream in streams.items() if not stream.isatty()]
    if elsewhere:
        raise ProgramError(Exit.USAGE, f"this needs a terminal, but there is none on {', '.join(elsewhere)}")
