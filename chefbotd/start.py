"""Where both programs start: before anything is imported that takes a user's time, Ctrl-C is already answered."""

import os
import sys
from importlib import import_module

INTERRUPTED = 130
"""As ``chefbotd.cli.common.exits`` has it, which is not imported yet."""


def chefbotd() -> None:
    """The daemon."""
    _run("chefbotd.cli.programs.chefbotd")


def chefbotctl() -> None:
    """The program that talks to it."""
    _run("chefbotd.cli.programs.chefbotctl")


def _run(program: str) -> None:
    """Import a program and run it; an interruption until then ends without a traceback."""
    open_standard_streams()
    try:
        import_module(program).main()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted.\n")
        sys.exit(INTERRUPTED)


def open_standard_streams() -> None:
    """Open /dev/null for each of stdin, stdout and stderr that is closed.

    Otherwise what is opened next, such as the event loop's own descriptor, would be in its place; libuv aborts on that.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
