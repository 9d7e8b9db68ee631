"""What the calibration leaves to a thread, with the real one, and what happens to the robot meanwhile."""

import asyncio
import importlib
import sys
import threading
from collections.abc import Mapping
from typing import Any, cast

import pytest

import chefbotd.components.calibration.algorithms
from chefbotd.bus import Bus
from chefbotd.clock import LoopClock
from chefbotd.components.calibration.algorithms import steps
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Estimate,
    Measurements,
    Procedure,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.build import robot_with
from chefbotd.components.calibration.models import (
    ApplyCalibrationParams,
    CalibrateParams,
    CalibrationApplied,
)
from chefbotd.components.calibration.service import CalibrationService
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.rpc.models import NoParams
from chefbotd.settings import load
from tests.chefbotd.components.calibration.test_procedure_runner import Driver

SETTINGS = load()
KEY = "chassis.track_multiplier"
CALLER, PROGRESS = cast("Any", None), cast("Any", type("Nobody", (), {"report": lambda *told: None}))


class Calibration:
    """A service, and the threads in which the configuration was read and written."""

    def __init__(self) -> None:
        self.bus, self.driver = Bus(), Driver()
        self.prepared, self.saved = list[str](), list[str]()
        self.stops_meanwhile = 0
        self.service = CalibrationService(
            self.bus,
            LoopClock(),
            cast("InnerDriver", self.driver),
            self._robot_with,
            self._save,
            self._fit,
        )
        self.bus.publish(SafetyChanged(0.0, "armed", "", None))

    def _robot_with(self, values: Mapping[str, float]) -> ConfiguredRobot:
        self.prepared.append(threading.current_thread().name)
        self.driver.stops += self.stops_meanwhile
        return robot_with(SETTINGS, values)

    def _save(self, values: Mapping[str, float]) -> CalibrationApplied:
        self.saved.append(threading.current_thread().name)
        return CalibrationApplied("robot.toml", "robot.toml.before", "", tuple(values))

    async def _fit(self, step: str, robot: ConfiguredRobot, measured: Measurements) -> StepResult:
        return StepResult(step, Status.PASSED, "", (Estimate(KEY, "", 1.0, 1.01, 0.001),))


def _nothing(robot: ConfiguredRobot) -> Procedure:
    yield from ()


def _fit_nothing(robot: ConfiguredRobot, measured: Measurements) -> StepResult:
    raise AssertionError("another process does that")


@pytest.fixture
def _fake_step(monkeypatch: pytest.MonkeyPatch) -> None:
    step = StepDefinition("fake", "nothing", "nothing", 0.0, lambda robot: "", _nothing, _fit_nothing)
    monkeypatch.setattr(steps, "STEPS", {"fake": step})


@pytest.mark.realtime
def test_the_steps_are_loaded_in_a_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes a fifth of a second keeps the control loop waiting neither for a list of the steps nor for a step."""
    loaded_in = list[str]()

    class Finder:
        """Notes who looks for the steps, and leaves finding them to others."""

        @staticmethod
        def find_spec(name: str, path: object = None, target: object = None) -> None:
            if name == "chefbotd.components.calibration.algorithms.steps":
                loaded_in.append(threading.current_thread().name)

    monkeypatch.setattr(sys, "meta_path", [Finder, *sys.meta_path])
    for ask in ("get_calibration", "calibrate"):
        monkeypatch.setattr(
            chefbotd.components.calibration.algorithms, "steps", steps
        )  # put back afterwards, as in sys.modules
        monkeypatch.delitem(sys.modules, "chefbotd.components.calibration.algorithms.steps")
        calibration = Calibration()
        if ask == "get_calibration":
            report = asyncio.run(calibration.service.get_calibration(CALLER, NoParams(), PROGRESS))
            assert [step.name for step in report.steps] == list(steps.STEPS)
        else:
            with pytest.raises(Refused, match="there is no step 'wings'"):
                asyncio.run(calibration.service.calibrate(CALLER, CalibrateParams(step="wings"), PROGRESS))
        assert calibration.prepared == ["calibration_0"]
    assert loaded_in == ["calibration_0"] * 2
    assert importlib.import_module("chefbotd.components.calibration.algorithms.steps") is not steps


@pytest.mark.realtime
@pytest.mark.usefixtures("_fake_step")
def test_the_configuration_is_written_in_a_thread() -> None:
    """Parsing, copying and flushing a file to the disk keep the control loop waiting for nothing."""
    calibration = Calibration()

    async def run() -> CalibrationApplied:
        await calibration.service.calibrate(CALLER, CalibrateParams(step="fake"), PROGRESS)
        return await calibration.service.apply_calibration(
            CALLER, ApplyCalibrationParams(steps=["fake"]), PROGRESS
        )

    assert asyncio.run(run()).keys == (KEY,)
    assert calibration.saved == ["calibration_0"]


@pytest.mark.realtime
@pytest.mark.usefixtures("_fake_step")
def test_a_stop_while_the_steps_are_loaded_ends_the_step() -> None:
    """Somebody who stops the robot before the first motion is obeyed, as in the middle of one."""
    calibration = Calibration()
    calibration.stops_meanwhile = 1
    with pytest.raises(Refused, match="the calibration was stopped by"):
        asyncio.run(calibration.service.calibrate(CALLER, CalibrateParams(step="fake"), PROGRESS))
    assert calibration.driver.driven == 0
