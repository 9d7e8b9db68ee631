"""Parts of the programs that need packages of an optional extra."""

from collections.abc import Iterator
from contextlib import contextmanager

from chefbotd.cli.common.exits import Exit, ProgramError


@contextmanager
def extra(name: str, *packages: str) -> Iterator[None]:
    """Around an import: say what to install when one of these packages of the extra ``name`` is missing.

    Raises:
        ProgramError: it is, or a shared library that it needs; any other failure to import passes through.
    """
    try:
        yield
    except ImportError as error:
        if error.name is not None and error.name.partition(".")[0] not in packages:
            raise
        advice = f"pip install 'chefbotd[{name}]'"
        raise ProgramError(Exit.NOT_INSTALLED, f"an optional part is missing ({error}): {advice}") from error
