"""The exit codes of both programs, the failure that ends with one, and parts that need packages of an optional extra."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from importlib import import_module

from chefbotd.extras import how_to_add_extra


class Exit(IntEnum):
    """The exit codes of chefbotd and chefbotctl."""

    OK = 0
    FAILED = 1
    USAGE = 2
    CANNOT_CONNECT = 3
    REFUSED = 4
    CONNECTION_LOST = 5
    NOT_DONE = 6
    NOT_INSTALLED = 7
    WARNINGS = 8
    PROBLEMS = 9
    BAD_CONFIGURATION = 78
    INTERRUPTED = 130
    OUTPUT_CLOSED = 141


MEANING = {
    Exit.OK: "done",
    Exit.FAILED: "an error that none of the others describes",
    Exit.USAGE: "wrong arguments",
    Exit.CANNOT_CONNECT: "no daemon answers at the address",
    Exit.REFUSED: "the robot refused (the kind of refusal is printed)",
    Exit.CONNECTION_LOST: "the connection broke, or an answer did not come in time",
    Exit.NOT_DONE: "the motion did not end as commanded",
    Exit.NOT_INSTALLED: "an optional part of the program is not installed",
    Exit.WARNINGS: "the doctor found nothing worse than warnings",
    Exit.PROBLEMS: "the doctor found problems",
    Exit.BAD_CONFIGURATION: "the configuration is not valid",
    Exit.INTERRUPTED: "interrupted by a signal",
    Exit.OUTPUT_CLOSED: "the reader of the output closed it (a shell's code for SIGPIPE)",
}


def exit_table(*codes: Exit) -> str:
    """The meaning of these codes as an epilog of ``--help``; the backspace keeps click from wrapping it."""
    rows = "\n".join(f"  {int(code):3d}  {MEANING[code]}" for code in sorted(codes))
    return f"\b\nExit codes:\n{rows}"


class ProgramError(Exception):
    """Ends the program: the exit code, a message for people, and details for a script."""

    def __init__(self, code: Exit, message: str, **details: object) -> None:
        super().__init__(message)
        self.code = code
        self.details = details


@contextmanager
def extra(name: str, *packages: str) -> Iterator[None]:
    """Around an import: tell the user to install the extra ``name`` if one of its ``packages`` is missing.

    Raises:
        ProgramError: a package, or a shared library that it needs, is missing. Other import errors pass unchanged.
    """
    try:
        yield
    except ImportError as error:
        if error.name is not None and error.name.partition(".")[0] not in packages:
            raise
        advice = how_to_add_extra(name)
        raise ProgramError(Exit.NOT_INSTALLED, f"an optional part is missing ({error}): {advice}") from error


def require(name: str, *packages: str) -> None:
    """Import the ``packages`` of the extra ``name``, so that a missing one is told before anything is begun.

    Raises:
        ProgramError: one of them, or a shared library that it needs, is missing.
    """
    with extra(name, *packages):
        for package in packages:
            import_module(package)
