"""Calibration: how far it is, what it asks, and what came of each step."""

from enum import StrEnum
from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.record import Level, LogLine, Record


class Ask(Record, frozen=True):
    """Ask a person for a number, in ``unit``, between the bounds; the robot stands meanwhile."""

    key: str
    text: str
    unit: str
    lowest: float
    highest: float
    done: float = 0.0


class Status(StrEnum):
    """The outcome of a step: ``not_enough`` names what is missing, ``refused`` why no result can be believed."""

    PASSED = "passed"
    NOT_ENOUGH = "not_enough"
    REFUSED = "refused"


class Estimate(Record, frozen=True):
    """A parameter before and after, and the standard deviation of the new value.

    ``key`` is its path in the configuration. The wheels, lidars and infrared sensors of a list are named:
    ``chassis.wheels.left_wheel.motor_sign``.
    """

    key: str
    unit: str
    before: float
    after: float
    sigma: float


class Residual(Record, frozen=True):
    """What the model leaves unexplained (root mean square), before and after; ``count`` measurements say so."""

    name: str
    unit: str
    before: float
    after: float
    count: int


class Series(Record, frozen=True):
    """One line (or with ``points`` one cloud) of a plot."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    points: bool = False


class Plot(Record, frozen=True):
    """A diagram with its axes' labels; ``equal`` axes have one scale."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    equal: bool = False


class StepResult(Record, frozen=True):
    """What came of a step; ``reason`` is for people, and empty where the step passed without a remark."""

    step: str
    status: Status
    reason: str = ""
    estimates: tuple[Estimate, ...] = ()
    residuals: tuple[Residual, ...] = ()
    plots: tuple[Plot, ...] = ()


class CalibrationData(Record, frozen=True):
    """What the calibration does. ``results`` are the newest of each step, without their plots."""

    state: Annotated[str, Meta(description="idle, moving, asking or computing")] = "idle"
    step: str = ""
    text: str = ""
    done: Annotated[float, Meta(description="share of the step, from 0 to 1")] = 0.0
    question: Ask | None = None
    results: tuple[StepResult, ...] = ()


class CalibrationChanged(CalibrationData, frozen=True, kw_only=True):
    """The calibration's progress."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log."""
        what = f"{self.step}: {self.text}" if self.step else self.text
        return LogLine(Level.INFO, "calibration", f"{self.state} ({what})" if what else self.state)
