"""Parts of the programs that need packages of an optional extra."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

from chefbotd.cli.common.exits import Exit, ProgramError


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
        advice = f"pip install 'chefbotd[{name}]'"
        raise ProgramError(Exit.NOT_INSTALLED, f"an optional part is missing ({error}): {advice}") from error


def require(name: str, *packages: str) -> None:
    """Import the ``packages`` of the extra ``name``, so that a missing one is told before anything is begun.

    Raises:
        ProgramError: one of them, or a shared library that it needs, is missing.
    """
    with extra(name, *packages):
        for package in packages:
            import_module(package)
