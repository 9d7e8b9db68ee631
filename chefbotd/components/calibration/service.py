"""Calibration on the socket: one step at a time, its result, and what is written of the results.

A step is a long request. It ends with its client, with any stop, and with whoever takes the robot over.
"""

import asyncio
import contextlib
import math
from collections.abc import Iterable, Iterator
from typing import Final

from msgspec import json

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.calibration.algorithms.step import (
    Action,
    Ask,
    ConfiguredRobot,
    Estimate,
    Measurements,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.events import CalibrationChanged
from chefbotd.components.calibration.fit_process import Fitter
from chefbotd.components.calibration.measuring import as_calibrated
from chefbotd.components.calibration.models import (
    TOPICS,
    AnswerCalibrationParams,
    ApplyCalibrationParams,
    CalibrateParams,
    CalibrationApplied,
    CalibrationReport,
)
from chefbotd.components.calibration.outside import CalibrationThread, RobotWith, Save, step_named
from chefbotd.components.calibration.procedure_runner import ALIVE_S, ProcedureRunner, ProcedureRunnerState
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import BatteryMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import BatteryLevelStatus
from chefbotd.core.record import MutableState, StatefulPart, replace
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.features.feature import Feature
from chefbotd.inputs import inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role

SCAN_AGE_S: Final = 2.0
"""An older scan says nothing about the space that is free now."""

AGREES_SIGMAS: Final = 3.0
"""Two runs that differ by more than this many standard deviations of their difference do not agree."""


class CalibrationState(MutableState):
    """What is remembered from one request to the next. A step that runs is not: a replay cannot begin inside it."""

    runner: ProcedureRunnerState
    results: tuple[StepResult, ...] = ()
    battery: BatteryMeasured | None = None


class CalibrationService(StatefulPart[CalibrationState]):
    """``robot_with`` and ``save`` know the configuration ``writes_to``; ``fit`` computes a result."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        driver: InnerDriver,
        robot_with: RobotWith,
        save: Save,
        fit: Fitter,
        writes_to: str = "",
    ) -> None:
        self._bus, self._entries = bus, inputs_of(clock)
        self._thread = CalibrationThread(self._entries, robot_with, save)
        self._robot_with, self._fit, self._writes_to = robot_with, fit, writes_to
        self._runner = ProcedureRunner(bus, clock, driver, self._take_action)
        self.memory, self.parts = CalibrationState(self._runner.memory), {"runner": self._runner}
        self._scans: dict[str, ScanMeasured] = {}
        self._step, self._state, self._report = "", "idle", _report_nothing
        self._action: Action | None = None
        bus.add_handler(self._take_battery, BatteryMeasured)
        bus.add_handler(self._take_scan, ScanMeasured)

    @method(role=Role.OBSERVE)
    async def get_calibration(
        self, caller: Caller, params: NoParams, progress: ProgressReporter
    ) -> CalibrationReport:
        """Return every step that can be calibrated, and the newest result of each."""
        steps = await self._thread.steps()
        return CalibrationReport(steps, self.memory.results, self._writes_to)

    @method(role=Role.DRIVE, moves=True)
    async def calibrate(
        self, caller: Caller, params: CalibrateParams, progress: ProgressReporter
    ) -> StepResult:
        """Carry out a step of the calibration; the robot moves. Nothing is written before ``apply_calibration``."""
        baseline = self._runner.take_baseline()
        with self._taking(params.step, progress):
            robot = await self._thread.robot(_values(self._others(params.step)))
            step = step_named(params.step)
            self._require(step, robot, params.space_m)
            measured = await self._runner.run(step.procedure(robot), baseline)
            self._publish_state("computing", "computes the parameters", 1.0)
            measured = as_calibrated(measured, self._robot_with({}), robot)
            result = self._compared(await self._fitted(step.name, robot, measured))
            self.memory.results = tuple((self._results | {step.name: result}).values())
        return result

    @property
    def _results(self) -> dict[str, StepResult]:
        return {result.step: result for result in self.memory.results}

    @contextlib.contextmanager
    def _taking(self, step: str, progress: ProgressReporter) -> Iterator[None]:
        """One step at a time; raises ``Refused`` while there is another."""
        if self._step:
            raise Refused(
                RefusalKind.CANNOT_CALIBRATE,
                Sentence("calibration.busy", "the step {step} is being carried out", step=self._step),
            )
        self._step, self._report = step, progress.report
        try:
            yield
        finally:
            self._step, self._report = "", _report_nothing
            if self._state != "idle":
                self._publish_state("idle")

    @method(role=Role.DRIVE, moves=False)
    def answer_calibration(self, caller: Caller, params: AnswerCalibrationParams) -> Done:
        """Answer the question that the calibration asks."""
        self._runner.answer(params.key, params.value)
        return DONE

    @method(role=Role.ADMIN, moves=False)
    async def apply_calibration(
        self, caller: Caller, params: ApplyCalibrationParams, progress: ProgressReporter
    ) -> CalibrationApplied:
        """Write results into the daemon's configuration, which keeps its comments; the old file is kept beside it."""
        if params.steps is not None:
            await self._thread.require_steps(params.steps)
        names = tuple(self._results if params.steps is None else params.steps)
        results = [self._results[name] for name in names if name in self._results]
        if missing := [name for name in names if name not in self._results]:
            raise Refused(
                RefusalKind.NOT_CALIBRATED,
                Sentence(
                    "calibration.no_result",
                    "{steps}: has no result yet; calibrate it first",
                    steps=", ".join(missing),
                ),
            )
        passed = [result for result in results if result.status is Status.PASSED]
        if failed := [result.step for result in results if result not in passed and params.steps is not None]:
            raise Refused(
                RefusalKind.NOT_CALIBRATED,
                Sentence(
                    "calibration.not_passed",
                    "{steps}: has not passed, so nothing is written",
                    steps=", ".join(failed),
                ),
            )
        values = _values(passed)
        if not values:
            raise Refused(
                RefusalKind.NOT_CALIBRATED,
                Sentence("calibration.none_passed", "no step has passed yet, so there is nothing to write"),
            )
        return await self._thread.write_configuration(values)

    def _require(self, step: StepDefinition, robot: ConfiguredRobot, space_m: float | None) -> None:
        """Check what must hold before anything moves.

        Raises:
            Refused: what does not.
        """
        if missing := step.missing(robot):
            raise Refused(
                RefusalKind.CANNOT_CALIBRATE,
                Sentence(
                    "calibration.missing",
                    "{step} cannot be calibrated: {missing}",
                    step=step.name,
                    missing=missing,
                ),
            )
        self._runner.require()
        battery = self.memory.battery
        if battery is not None and battery.status is not BatteryLevelStatus.OK:
            reason = Sentence(
                "calibration.battery",
                "the battery is {status} ({voltage_v:.1f} V): charge it first",
                status=battery.status,
                voltage_v=battery.voltage_v,
            )
            raise Refused(RefusalKind.CANNOT_CALIBRATE, reason)
        if step.space_m:
            self._require_space(step, robot, space_m)

    def _require_space(self, step: StepDefinition, robot: ConfiguredRobot, told_m: float | None) -> None:
        from chefbotd.components.calibration.algorithms.space import free_space  # loads numpy

        now_s = self._entries.now_s()
        seen = free_space(robot, [scan for scan in self._scans.values() if now_s - scan.stamp_s < SCAN_AGE_S])
        if seen is not None and seen.distance_m < step.space_m:
            reason = Sentence(
                "calibration.lidar_sees",
                "{step} needs {space_m:g} m of free floor around the robot; the lidar sees {seen}",
                step=step.name,
                space_m=step.space_m,
                seen=seen,
            )
            raise Refused(RefusalKind.CANNOT_CALIBRATE, reason)
        if seen is None and (told_m is None or told_m < step.space_m):
            reason = (
                Sentence(
                    "calibration.say_room",
                    "{step} needs {space_m:g} m of free floor around the robot, and no lidar sees whether there is: "
                    "say how much there is",
                    step=step.name,
                    space_m=step.space_m,
                )
                if told_m is None
                else Sentence(
                    "calibration.too_little_room",
                    "{step} needs {space_m:g} m of free floor around the robot, and no lidar sees more than you say: "
                    "say how much there is",
                    step=step.name,
                    space_m=step.space_m,
                )
            )
            raise Refused(RefusalKind.CANNOT_CALIBRATE, reason)

    async def _tell_computing(self) -> None:
        while True:
            await asyncio.sleep(ALIVE_S)
            self._report(1.0, 1.0, "computes the parameters")

    async def _fitted(self, step: str, robot: ConfiguredRobot, measured: Measurements) -> StepResult:
        """The result as the other process computed it; a replay has it from the recording."""

        async def ask() -> str:
            telling = asyncio.create_task(self._tell_computing())
            try:
                return json.encode(await self._fit(step, robot, measured)).decode()
            finally:
                telling.cancel()

        return json.decode(await self._entries.answer(f"calibration {step}", ask), type=StepResult)

    def _others(self, name: str) -> list[StepResult]:
        return [
            result
            for result in self._results.values()
            if result.step != name and result.status is Status.PASSED
        ]

    def _compared(self, result: StepResult) -> StepResult:
        """The result, which says where it does not agree with the one before."""
        before = self._results.get(result.step)
        if before is None or before.status is not Status.PASSED or result.status is not Status.PASSED:
            return result
        apart = "; ".join(_disagreements(before.estimates, result.estimates))
        if not apart:
            return result
        reason = Sentence(
            "calibration.disagrees", "this run does not agree with the one before: {apart}", apart=apart
        )
        return replace(result, reason=join_sentences((result.reason, reason)))

    def _take_action(self, action: Action) -> None:
        state = "asking" if isinstance(action, Ask) else "moving"
        if action is self._action:
            self._report(action.done, 1.0, action.text)
            return
        self._action = action
        self._publish_state(state, action.text, action.done, action if isinstance(action, Ask) else None)

    def _publish_state(
        self, state: str, text: str = "", done: float = 0.0, question: Ask | None = None
    ) -> None:
        results = tuple(replace(result, plots=()) for result in self._results.values())
        self._state = state
        self._bus.publish(
            CalibrationChanged(
                stamp_s=self._entries.now_s(),
                state=state,
                step=self._step,
                text=text,
                done=done,
                question=question,
                results=results,
            )
        )
        self._report(done, 1.0, text)

    def _take_battery(self, event: BatteryMeasured) -> None:
        self.memory.battery = event

    def _take_scan(self, event: ScanMeasured) -> None:
        self._scans[event.lidar] = event


def _report_nothing(done: float, total: float, text: str = "") -> None:
    """Nobody waits for a step."""


def _values(results: Iterable[StepResult]) -> dict[str, float]:
    return {estimate.key: estimate.after for result in results for estimate in result.estimates}


def _disagreements(before: Iterable[Estimate], after: Iterable[Estimate]) -> Iterable[str]:
    """Where two runs differ by more than their standard deviations allow."""
    earlier = {estimate.key: estimate for estimate in before}
    for estimate in after:
        other = earlier.get(estimate.key)
        if other is None:
            continue
        sigma = math.hypot(estimate.sigma, other.sigma)
        if abs(estimate.after - other.after) > AGREES_SIGMAS * sigma:
            unit = f" {estimate.unit}" if estimate.unit else ""
            yield f"{estimate.key} was {other.after:.6g}{unit}, is {estimate.after:.6g}{unit} (sigma {sigma:.2g})"


def calibration(service: CalibrationService) -> Feature:
    """The feature that calibrates the robot."""
    return Feature("calibration", methods=methods_of(service), topics=TOPICS, parts={"calibration": service})
