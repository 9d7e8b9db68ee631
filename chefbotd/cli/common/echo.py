"""Printing on standard output: a full disk, or a reader that has left, is told as what it is."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

from chefbotd.cli.common.exits import Exit, ProgramError


@contextmanager
def writing() -> Iterator[None]:
    """Around whatever prints.

    Raises:
        ProgramError: it could not be written; ``OUTPUT_CLOSED`` when the reader has left, as ``head`` does.
    """
    try:
        yield
    except OSError as error:
        _let_go()
        code = Exit.OUTPUT_CLOSED if isinstance(error, BrokenPipeError) else Exit.FAILED
        raise ProgramError(code, f"cannot write the output: {error.strerror}") from error


def _let_go() -> None:
    """What is still in the buffer goes nowhere, or it would fail once more as the interpreter ends."""
    void = os.open(os.devnull, os.O_WRONLY)
    os.dup2(void, sys.stdout.fileno())
    os.close(void)


def echo(text: str) -> None:
    """Print a line; raises as ``writing`` does."""
    with writing():
        click.echo(text)
