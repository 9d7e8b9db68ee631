"""Printing on standard output, with an exit code for a full disk and for closed output."""

import os
import shutil
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import click

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.core.printable import plain

WIDEST: Final = 100
"""Sentences are not wider than this on a terminal, however wide it is."""


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


def echo(text: str, *, styled: str = "") -> None:
    """Print a line, behind what is ``styled`` by the program itself; raises as ``writing`` does."""
    with writing():
        click.echo(styled + plain(text))


def say_sentences(text: str) -> None:
    """Print sentences, folded between words on a terminal. Raises as ``writing`` does."""
    echo(fold(text) if sys.stdout.isatty() else text)


def tell(text: str, *, line_end: bool = True, folded: bool = True) -> None:
    """Print a line on standard error. Sentences are ``folded`` between words on a terminal, JSON is not."""
    click.echo(plain(fold(text) if folded and sys.stderr.isatty() else text), nl=line_end, err=True)


def fold(text: str) -> str:
    """Each line in as many as the terminal, or ``WIDEST``, asks for. A path or an address is not broken."""
    width = min(WIDEST, shutil.get_terminal_size().columns)
    return "\n".join(_fold_line(line, width) for line in text.split("\n"))


def _fold_line(line: str, width: int) -> str:
    if len(line) <= width:
        return line
    return textwrap.fill(
        line, width, break_long_words=False, break_on_hyphens=False,
        replace_whitespace=False, drop_whitespace=True,
    )  # fmt: skip


def need_terminal() -> None:
    """Check that there is a terminal (Textual reads stdin and draws on stderr).

    Raises:
        ProgramError: stdin, stdout or stderr is a file or a pipe.
    """
    streams = {"standard input": sys.stdin, "standard output": sys.stdout, "standard error": sys.stderr}
    elsewhere = [name for name, stream in streams.items() if not stream.isatty()]
    if elsewhere:
        raise ProgramError(Exit.USAGE, f"this needs a terminal, but there is none on {', '.join(elsewhere)}")
