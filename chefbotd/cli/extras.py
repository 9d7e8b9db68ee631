"""Parts of the programs that need packages of an optional extra."""

from collections.abc import Iterator
from contextlib import contextmanager

from chefbotd.cli.exits import Exit, ProgramError


@contextmanager
def extra(name: str, *packages: str) -> Iterator[None]:
    """Around an import: say what to install when one of these packages of the extra ``name`` is missing.

    Raises:
        ProgramError: it is; any other failure to import is a fault and passes through.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in packages:
            raise
        raise not_installed(name, missing) from error


def not_installed(name: str, missing: str) -> ProgramError:
    """The end of a program whose extra is not there."""
    return ProgramError(
        Exit.NOT_INSTALLED, f"this needs {missing}, which is not installed: pip install 'chefbotd[{name}]'"
    )
