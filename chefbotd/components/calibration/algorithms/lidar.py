"""The step ``lidar``: the mount of each lidar, where the wheels' parameters are right.

It drives and fits as ``wheels`` does, for half of the time, and leaves radii and track as they are. A robot with several
lidars needs it, because ``wheels`` finds the mount of the first one only.
"""

from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Measurements,
    Procedure,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.algorithms.wheels import SPACE_M, drive_and_look, missing


def _procedure(robot: ConfiguredRobot) -> Procedure:
    yield from drive_and_look(robot, 1)


def _fit(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    from chefbotd.components.calibration.algorithms.wheel_result import (
        fit_mount,  # matches scans, so it loads a compiler
    )

    results = [fit_mount(robot, measurements, lidar) for lidar in robot.lidars]
    passed = [result for result in results if result.status is Status.PASSED]
    status = Status.PASSED if passed else max(result.status for result in results)
    return StepResult(
        "lidar",
        status,
        "; ".join(result.reason for result in results if result.reason),
        tuple(estimate for result in passed for estimate in result.estimates),
        tuple(residual for result in passed for residual in result.residuals),
        tuple(plot for result in passed for plot in result.plots),
    )


LIDAR = StepDefinition(
    "lidar",
    "the mount of each lidar, where the wheels are calibrated",
    "Put the robot on the floor where it will drive, among furniture or walls that its lidars see.",
    SPACE_M,
    missing,
    _procedure,
    _fit,
    on_request=True,
)
