"""The results of all steps: what no fit may hand on."""

import math

import numpy as np
import pytest

from chefbotd.components.calibration.algorithms import steps
from chefbotd.components.calibration.algorithms.least_squares import solve
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Estimate,
    Measurements,
    Plot,
    Residual,
    Series,
    Status,
    StepDefinition,
    StepResult,
)
from tests.chefbotd.components.calibration.algorithms.synthetic import configured

ROBOT = configured()
KEY = "chassis.track_multiplier"
PASSED = StepResult("fake", Status.PASSED, "", (Estimate(KEY, "", 1.0, 1.01, 0.001),))


def _result(monkeypatch: pytest.MonkeyPatch, fit: object) -> StepResult:
    """What comes of a step with this fit."""
    step = StepDefinition("fake", "", "", 0.0, lambda robot: "", lambda robot: iter(()), fit)  # type: ignore[arg-type]
    monkeypatch.setattr(steps, "STEPS", {"fake": step})
    return steps.fit_step("fake", ROBOT, Measurements())


def test_a_result_of_finite_numbers_is_handed_on_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is changed in it."""
    assert _result(monkeypatch, lambda robot, measured: PASSED) == PASSED


@pytest.mark.parametrize(
    ("result", "what"),
    [
        (StepResult("fake", Status.PASSED, "", (Estimate(KEY, "", 1.0, math.nan, 0.001),)), KEY),
        (StepResult("fake", Status.PASSED, "", (Estimate(KEY, "", 1.0, 1.01, math.inf),)), KEY),
        (
            StepResult("fake", Status.PASSED, "", (), (Residual("turns", "rad", 0.1, math.nan, 5),)),
            "the residuals of turns",
        ),
        (
            StepResult(
                "fake", Status.PASSED, "", plots=(Plot("t", "x", "y", (Series("s", (0.0,), (math.nan,)),)),)
            ),
            "the plot of t",
        ),
    ],
)
def test_a_number_that_is_not_finite_refuses_the_result(
    monkeypatch: pytest.MonkeyPatch, result: StepResult, what: str
) -> None:
    """NaN or infinity in an estimate, a residual or a plot: the reason names it, and nothing else is left."""
    refused = StepResult("fake", Status.REFUSED, f"the fit gives no finite number for {what}")
    assert _result(monkeypatch, lambda robot, measured: result) == refused


def test_a_fit_without_a_solution_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Least squares of residuals that are NaN raise; the step ends with the reason."""

    def fit(robot: ConfiguredRobot, measured: Measurements) -> StepResult:
        solve(lambda values: np.full((3, 1), math.nan), np.zeros(1))
        return PASSED

    result = _result(monkeypatch, fit)
    assert (result.status, result.estimates) == (Status.REFUSED, ())
    assert result.reason.startswith("the fit has no solution: ")


def test_every_preparation_is_a_whole_sentence() -> None:
    """The page and the terminal put more sentences behind it."""
    for step in steps.STEPS.values():
        assert step.preparation[:1].isupper(), step.name
        assert step.preparation.endswith("."), step.name
