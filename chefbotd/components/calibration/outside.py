"""What the calibration does outside of the event loop, which runs the control: in one thread, one thing at a time.

It loads the steps with their numerics (0.2 s), and reads and writes the configuration. A thread is given up only before
it begins; so nothing is written by half, and of two that write, the second writes into what the first has written.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias, TypeVar

from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, StepDefinition
from chefbotd.components.calibration.models import CalibrationApplied, CalibrationStep
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import InputLog

T = TypeVar("T")

Values: TypeAlias = Mapping[str, float]
RobotWith: TypeAlias = Callable[[Values], ConfiguredRobot]
"""The robot as it is configured, with these values; raises ``Refused`` where they do not fit."""

Save: TypeAlias = Callable[[Values], CalibrationApplied]
"""Writes values into the configuration; raises ``Refused``."""


class CalibrationThread:
    """``robot_with`` and ``save`` know the configuration."""

    def __init__(self, entries: InputLog, robot_with: RobotWith, save: Save) -> None:
        self._entries, self._robot_with, self._save = entries, robot_with, save
        self._threads = ThreadPoolExecutor(1, "calibration")

    async def robot(self, values: Values) -> ConfiguredRobot:
        """The robot with these values; afterwards the steps are loaded. A replay makes the same of the same values.

        Raises:
            Refused: the values do not fit the configuration.
        """
        robots: list[ConfiguredRobot] = []

        def prepare() -> str:
            _load_steps()
            try:
                robots.append(self._robot_with(values))
            except Refused as refused:
                return str(refused)
            return ""

        if refusal := await self._entries.answer("calibration robot", lambda: self._in_thread(prepare)):
            raise Refused(RefusalKind.CANNOT_CALIBRATE, refusal)
        return robots[0] if robots else self._robot_with(values)

    async def steps(self) -> tuple[CalibrationStep, ...]:
        """Every step, and what this robot lacks for it."""

        def rows() -> tuple[CalibrationStep, ...]:
            robot = self._robot_with({})
            return tuple(
                CalibrationStep(
                    step.name,
                    step.purpose,
                    step.preparation,
                    step.space_m,
                    step.missing(robot),
                    step.on_request,
                )
                for step in _load_steps().values()
            )

        return await self._entries.outside(lambda: self._in_thread(rows))

    async def require_steps(self, names: Iterable[str]) -> None:
        """Raises ``Refused`` where there is no step of one of these names."""

        def check() -> None:
            for name in names:
                step_named(name)

        await self._entries.outside(lambda: self._in_thread(check))

    async def write_configuration(self, values: Values) -> CalibrationApplied:
        """Write values into the configuration; raises ``Refused``."""
        return await self._entries.outside(lambda: self._in_thread(lambda: self._save(values)))

    async def _in_thread(self, function: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._threads, function)


def step_named(name: str) -> StepDefinition:
    """The step of this name; raises ``Refused``: there is none. Call it where the steps are loaded."""
    steps = _load_steps()
    if name not in steps:
        raise Refused(
            RefusalKind.CANNOT_CALIBRATE,
            Sentence(
                "calibration.unknown_step",
                "there is no step {step!a}, expected one of {steps}",
                step=name,
                steps=", ".join(steps),
            ),
        )
    return steps[name]


def _load_steps() -> Mapping[str, StepDefinition]:
    """The steps, loaded when somebody asks: a robot that is not calibrated does without their numerics."""
    from chefbotd.components.calibration.algorithms.steps import STEPS

    return STEPS
