"""Where both programs start: before anything is imported that takes a user's time, Ctrl-C is already answered."""

import gc
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from types import ModuleType
from typing import TextIO, cast

INTERRUPTED = 130
"""As ``chefbotd.cli.common.exits`` has it, which is not imported yet."""


def chefbotd() -> None:
    """The daemon. It stops the motors before it imports the rest."""
    _run("chefbotd.cli.programs.chefbotd", first=_stop_motors)


def chefbotctl() -> None:
    """The program that talks to it."""
    _run("chefbotd.cli.programs.chefbotctl")


def _stop_motors() -> None:
    from chefbotd.link.early_stop import stop_early

    stop_early(sys.argv[1:], os.environ)


def _run(program: str, first: Callable[[], None] = lambda: None) -> None:
    """Import a program and run it; an interruption until then ends without a traceback."""
    open_standard_streams()
    try:
        first()
        with no_collections():
            main = import_module(program).main
        main()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted.\n")
        sys.exit(INTERRUPTED)


def open_standard_streams() -> None:
    """Open /dev/null for each of stdin, stdout and stderr that is closed.

    Otherwise what is opened next, such as the event loop's own descriptor, would be in its place; libuv aborts on that.
    Python has None for the stream of each that was closed when it started.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
    sys.stdin = sys.stdin or _null(0, "r")
    sys.stdout = sys.stdout or _null(1, "w")
    sys.stderr = sys.stderr or _null(2, "w")


def _null(descriptor: int, mode: str) -> TextIO:
    """A stream on a descriptor that stays open when the stream is dropped."""
    return cast(TextIO, open(descriptor, mode, encoding="utf-8", closefd=False))


@contextmanager
def no_collections() -> Iterator[None]:
    """Import without the garbage collector: it looks at every module and class again and again, and finds no garbage.

    Afterwards it passes over them: a look at all of them takes as long as several control steps.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@contextmanager
def light_imports() -> Iterator[None]:
    """Load what is imported meanwhile fast and small; pydantic and structlog must not have been imported before.

    - pydantic looks for plugins in every installed package, and loads what reads their metadata, parsers of mail and
      tables among it; chefbotd uses none.
    - structlog imports rich, to lay out tracebacks, twisted and greenlet wherever they are installed, and does without
      where that fails.

    Neither has a setting that keeps these modules away: ``PYDANTIC_DISABLE_PLUGINS`` keeps away plugins only.
    Without the stand-ins both take half as much time again to import, and 6 MB more.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    with no_collections():
        if "structlog" not in sys.modules:
            _import_beside("structlog", {"rich": None, "twisted": None, "greenlet": None})
        if "pydantic" not in sys.modules and "importlib.metadata" not in sys.modules:
            no_plugins = ModuleType("importlib.metadata")
            no_plugins.entry_points = tuple  # type: ignore[attr-defined]
            _import_beside("pydantic.plugin._loader", {"importlib.metadata": no_plugins})
        yield


def _import_beside(module: str, instead: Mapping[str, ModuleType | None]) -> None:
    """Import a module while others have stand-ins; None as if one were not installed (see ``sys.modules``).

    A module that has changed and asks more of a stand-in is imported as usual.
    """
    hidden = {name: sys.modules[name] for name in instead if name in sys.modules}
    sys.modules.update(instead)  # type: ignore[arg-type]
    try:
        with suppress(ImportError):
            import_module(module)
    finally:
        for name in instead:
            del sys.modules[name]
        sys.modules.update(hidden)
