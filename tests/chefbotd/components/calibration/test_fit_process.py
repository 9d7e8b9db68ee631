"""Fits in a process of their own, with the real one."""

import asyncio
import math

import pytest

from chefbotd.components.calibration import fit_process
from chefbotd.components.calibration.algorithms.by_hand import TURNS
from chefbotd.components.calibration.algorithms.step import Measurements, Status
from chefbotd.components.calibration.build import robot_with
from chefbotd.components.calibration.fit_process import fit_here, fit_in_process
from chefbotd.core.events import WheelsMeasured
from chefbotd.settings import load, packaged

ROBOT = robot_with(load(packaged("chefbot_lidar")), {})


@pytest.mark.realtime
def test_the_process_answers_as_a_call_would() -> None:
    """Of a robot that has measured nothing both say the same: it is not enough."""
    result = asyncio.run(fit_in_process("wheels", ROBOT, Measurements()))
    assert result.status is Status.NOT_ENOUGH
    assert result == asyncio.run(fit_here("wheels", ROBOT, Measurements()))


@pytest.mark.realtime
def test_a_process_that_fails_is_no_result() -> None:
    """Its last words are the reason, and nothing is raised in the daemon."""
    result = asyncio.run(fit_in_process("no such step", ROBOT, Measurements()))
    assert result.status is Status.REFUSED
    assert "KeyError: 'no such step'" in result.reason


@pytest.mark.realtime
def test_a_result_that_is_no_number_is_refused() -> None:
    """A wheel that turned by NaN has NaN counts in a turn, which no configuration may get: the reason names them."""
    reading = WheelsMeasured(1.0, 1.0, 1.0, (0.0, 0.0), (math.nan, math.nan), (0.0, 0.0))
    measured = Measurements(wheels=(reading,), answers={f"{TURNS}left_wheel": 5.0})
    result = asyncio.run(fit_in_process("encoders", ROBOT, measured))
    assert (result.status, result.estimates) == (Status.REFUSED, ())
    assert result.reason == "the fit gives no finite number for encoders.counts_per_turn"


@pytest.mark.realtime
def test_a_fit_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it is at when its time is over, it is no result, and the process is gone."""
    monkeypatch.setattr(fit_process, "TIMEOUT_S", 0.0)

    async def run() -> None:
        result = await fit_in_process("wheels", ROBOT, Measurements())
        assert (result.status, result.reason) == (Status.REFUSED, "the computation took longer than 0 s")

    asyncio.run(run())
