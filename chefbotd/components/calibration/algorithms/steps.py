"""The steps of a calibration, in the order in which each can use the results of those before."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from chefbotd.components.calibration.algorithms import motors
from chefbotd.components.calibration.algorithms.by_hand import BATTERY, ENCODERS
from chefbotd.components.calibration.algorithms.imu import IMU
from chefbotd.components.calibration.algorithms.lidar import LIDAR
from chefbotd.components.calibration.algorithms.sensors import SENSORS
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Measurements,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.algorithms.umbmark import UMBMARK
from chefbotd.components.calibration.algorithms.wheels import WHEELS

ORDER: tuple[StepDefinition, ...] = (ENCODERS, BATTERY, motors.STEP, WHEELS, UMBMARK, LIDAR, IMU, SENSORS)

STEPS: Mapping[str, StepDefinition] = {step.name: step for step in ORDER}


def fit_step(name: str, robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    """The result of the step of this name; ``refused`` where the fit has no solution, or a number is not finite."""
    try:
        result = STEPS[name].fit(robot, measurements)
    except np.linalg.LinAlgError as problem:
        return StepResult(name, Status.REFUSED, f"the fit has no solution: {problem}")
    not_finite = ", ".join(what for what, numbers in _numbers(result) if not all(map(math.isfinite, numbers)))
    if not_finite:
        return StepResult(name, Status.REFUSED, f"the fit gives no finite number for {not_finite}")
    return result


def _numbers(result: StepResult) -> Iterator[tuple[str, tuple[float, ...]]]:
    """All numbers of a result, by what they are of."""
    for estimate in result.estimates:
        yield estimate.key, (estimate.before, estimate.after, estimate.sigma)
    for residual in result.residuals:
        yield f"the residuals of {residual.name}", (residual.before, residual.after)
    for plot in result.plots:
        yield f"the plot of {plot.title}", tuple(value for one in plot.series for value in (*one.x, *one.y))
