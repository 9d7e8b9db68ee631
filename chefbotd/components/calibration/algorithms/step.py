"""A step of the calibration: motions that tell something, and a fit to all that was measured.

A procedure is a generator. It yields what the robot does next, and is sent what was measured meanwhile; so it can choose
a motion by what it saw. The fit gets everything that was measured at once. It therefore works on a recorded drive too.
"""

from collections.abc import Callable, Generator, Iterator, Mapping
from typing import TypeAlias

from chefbotd.components.calibration.events import Ask, Estimate, Plot, Residual, Series, Status, StepResult
from chefbotd.core.events import (
    BatteryMeasured,
    DutyEchoed,
    ImuMeasured,
    RangeMeasured,
    TruthSimulated,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Motion, WheelDuties
from chefbotd.core.record import Record
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.odometry import FusionParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters

__all__ = [
    "Action",
    "Ask",
    "ConfiguredRobot",
    "Estimate",
    "Measurements",
    "Move",
    "Plot",
    "Procedure",
    "Residual",
    "Series",
    "Status",
    "StepDefinition",
    "StepResult",
]


LEAST_LEFT = 1e-4
"""No calibration is better, whatever its residuals say: tyres wear, and carry more or less."""

SIGMA_SHARE = 1 / 3
"""How uncertain a standard deviation is by itself (assumed)."""


class ConfiguredRobot(Record, frozen=True):
    """The robot as it is configured, with the results of other steps so far: what a step starts from.

    Of the step's own parameters, it has those in force while the measurements were made. A scan's mount is the one in
    ``lidars``; the scan's own ``base_from_lidar`` does not have the results of other steps.
    ``outline_radius_m`` is that of the circle around the body, centred at the middle of the axle.
    """

    chassis: ChassisParameters
    encoders: EncoderParameters
    drive: DriveParameters
    gains: Mapping[str, PidParameters]
    limits: MotionLimits
    battery: BatteryParameters | None
    outline_radius_m: float
    imu: ImuParameters | None = None
    ultrasonic: UltrasonicParameters | None = None
    infrared: tuple[InfraredParameters, ...] = ()
    lidars: tuple[LidarParameters, ...] = ()
    fusion: FusionParameters = FusionParameters()

    def left_uncertain(self, sigmas: Mapping[str, float]) -> Iterator[Estimate]:
        """What the calibration leaves uncertain, by its key in ``[odometry.fusion]``, which takes it for constant."""
        for key, sigma in sigmas.items():
            before, after = float(getattr(self.fusion, key)), max(sigma, LEAST_LEFT)
            yield Estimate(f"odometry.fusion.{key}", "", before, after, after * SIGMA_SHARE)


class Measurements(Record, frozen=True):
    """What was measured, each kind in the order of its times.

    ``driven`` and ``wheels`` have an element for each control step, ``driven`` with the duty commanded after it;
    ``echoed`` is the duty in force, as the board reports it.
    ``answers`` are what a person typed, by the question's key.
    ``truth`` is what a simulator or a motion capture system says.
    """

    wheels: tuple[WheelsMeasured, ...] = ()
    driven: tuple[WheelsDriven, ...] = ()
    imu: tuple[ImuMeasured, ...] = ()
    scans: tuple[ScanMeasured, ...] = ()
    ranges: tuple[RangeMeasured, ...] = ()
    battery: tuple[BatteryMeasured, ...] = ()
    echoed: tuple[DutyEchoed, ...] = ()
    truth: tuple[TruthSimulated, ...] = ()
    answers: Mapping[str, float] = {}


class Move(Record, frozen=True):
    """Drive like this for so long, then stand until the wheels are at rest. Without a motion the robot stands.

    ``settled`` False goes straight on to the next action. ``done`` is the share of the step that is then behind it, and
    ``text`` says what the robot does.
    """

    motion: Motion | WheelDuties | None
    duration_s: float
    text: str
    done: float = 0.0
    settled: bool = True


Action: TypeAlias = Move | Ask
Procedure: TypeAlias = Generator[Action, Measurements, None]
"""Is sent what was measured during the action that it has yielded; an ``Ask`` is answered in ``answers``."""


class StepDefinition(Record, frozen=True):
    """One step. ``preparation`` says what a person does first; the robot needs ``space_m`` of free floor around it.

    ``missing(robot)`` says why this robot cannot take the step (empty: it can). ``fit(robot, measurements)`` never
    raises for bad measurements: its result says ``not_enough`` or ``refused``. A step ``on_request`` is left out of a
    calibration of everything, because another step finds the same.
    """

    name: str
    purpose: str
    preparation: str
    space_m: float
    missing: Callable[[ConfiguredRobot], str]
    procedure: Callable[[ConfiguredRobot], Procedure]
    fit: Callable[[ConfiguredRobot, Measurements], StepResult]
    on_request: bool = False
