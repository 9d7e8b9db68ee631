"""The command's list of steps, which is repeated so that the program starts without them."""

from chefbotd.components.calibration.algorithms.steps import STEPS
from chefbotd.components.calibration.cli.commands import NAMES


def test_the_command_knows_every_step() -> None:
    """And no other."""
    assert set(NAMES) == STEPS.keys()
