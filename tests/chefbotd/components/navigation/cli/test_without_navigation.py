"""chefbotctl where the extra navigation is not installed, such as on a laptop."""

import subprocess
import sys

import pytest

from chefbotd.cli.common.exits import Exit
from tests.budget import sample
from tests.waiting import PATIENCE_S

WITHOUT = """
import sys
sys.modules["numba"] = sys.modules["scipy"] = None
from chefbotd import start
sys.argv = ["chefbotctl", "--connect", "127.0.0.1:1", *{command}]
start.chefbotctl()
"""


def chefbotctl(*command: str) -> tuple[int, str]:
    """Exit code and stderr of a command; no daemon answers."""
    program = WITHOUT.format(command=command)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("command", sample(["go 1 2", "home", "dock", "patrol a b"]))
def test_a_robot_is_sent_from_any_computer(command: str) -> None:
    """The robot plans, and not this computer: all that is missing here is a daemon."""
    code, said = chefbotctl(*command.split())
    assert (code, "Traceback" in said) == (Exit.CANNOT_CONNECT, False), said
