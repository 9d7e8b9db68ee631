"""Faults of the whole matrix on the firmware's image (``python -m tests.scenarios.matrix --robot chefbot/emulated``)."""

import pytest

from tests.firmware.emulator import built
from tests.scenarios.matrix import VIRTUAL, trials
from tests.scenarios.robots import EMULATED

FAULTS = (
    "cable pulled for 1 s",
    "board reset on request",
    "board reads nothing, estop",
    "estop behind half a line",
    "board's clock wraps",
    "wall ahead",
    "wall ahead, wheels commanded",
)


@pytest.mark.parametrize("name", FAULTS)
def test_the_outcome_is_the_one_that_is_defined(name: str) -> None:
    """As docs/safety.md has it for our own firmware."""
    built()
    (trial,) = trials([EMULATED], lambda other: other == name, VIRTUAL)
    result = trial.part.attempt(trial.fault, EMULATED)
    assert result.wrong == ()
