"""A part of the fault matrix; `make faults` runs all of it."""

import dataclasses

import pytest

from tests.scenarios import trial
from tests.scenarios.faults import FAULTS
from tests.scenarios.matrix import run, table, totals
from tests.scenarios.trial import Expected

PART = {
    "driver falls silent",
    "estop",
    "encoder reversed, wheel 0",
    "cable pulled for 1 s",
    "task lost: drive",
}
NAMES = {fault.name: fault for fault in FAULTS}


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_a_part_of_the_matrix_goes_as_defined(robot: str):
    """A fault of each sort has its one outcome, within its time, and is left again."""
    results = list(run([robot], PART.__contains__))
    assert {result.fault for result in results} == PART
    assert [result.wrong for result in results] == [()] * len(PART)
    assert totals(results)["faults injected"] == len(PART)
    assert table(results).row_count == len(PART)


@pytest.mark.parametrize(
    ("expected", "complaint"),
    [
        (Expected("estopped", None, 0.0001), "duty for 0.0"),
        (Expected("armed", None, 0.1), "told as ('estopped', None)"),
        (Expected("estopped"), "does not drive on"),
    ],
)
def test_another_outcome_than_the_defined_one_is_told(expected: Expected, complaint: str):
    """Too late, another mode, or a robot that stands where it should drive on."""
    result = trial.attempt(dataclasses.replace(NAMES["estop"], expected=expected), "chefbot")
    assert any(told.startswith(complaint) for told in result.wrong)
