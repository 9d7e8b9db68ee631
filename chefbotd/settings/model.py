"""The configuration as validated and frozen parameters, one section for each part of the robot.

A key is a field of the parameter class that lives beside its algorithm.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, TypeAlias, TypeVar

from pydantic import Field, ValidationInfo, field_validator

from chefbotd.component_list import own_components
from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters, section
from chefbotd.link.port import LinkParameters
from chefbotd.link.wires import wires
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.edge_speed import QuadratureParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.odometry import OdometryParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.rpc.parameters import ApiParameters, PluginsParameters
from chefbotd.safety.gate import SafetyParameters
from chefbotd.safety.latch import LatchParameters
from chefbotd.safety.watchdog import ControlParameters, WatchdogParameters
from chefbotd.sensing.battery import BatteryParameters
from chefbotd.sensing.imu import ImuParameters
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters
from chefbotd.settings.sections import with_sections
from chefbotd.transport.parameters import PageParameters


class BodyParameters(Parameters):
    """The body's shape and masses.

    Its length and width, with all that sticks out, are the outline that a lidar's obstacle guard and navigation keep off
    everything; where there is no body, the box about the wheels is. Only the robot's description needs the rest.

    The body is a box, or a cylinder of diameter ``length_m`` where ``width_m`` is left out. It is centred over the
    middle of the wheels, its underside ``ground_clearance_m`` above the floor. Without a mass a link has no inertia.
    """

    length_m: float = Field(gt=0, le=5)
    """The outline's length with all that sticks out; without ``width_m`` the diameter of a round body."""
    width_m: float | None = Field(default=None, gt=0, le=5)
    """The outline's width with all that sticks out; left out, the body is round."""
    height_m: float = Field(gt=0, le=5)
    """The body's height, for the description alone."""
    ground_clearance_m: float = Field(default=0.0, ge=0, le=5)
    """How far the body's underside is above the floor, for the description alone."""
    mass_kg: float | None = Field(default=None, gt=0, le=500)
    """The body's mass without the wheels, for the description's inertia."""
    wheel_width_m: float = Field(default=0.025, gt=0, le=1)
    """The width of each wheel, for the description and for the outline of a robot without a body."""
    wheel_mass_kg: float | None = Field(default=None, gt=0, le=100)
    """The mass of each wheel, for the description's inertia."""


Level = Literal["debug", "info", "warning", "error"]


class RobotParameters(Parameters):
    """Which robot this is; ``wire`` names the variant of the board's lines (``firmware_protocol.codec.VARIANTS``).

    ``description`` is the path of the user's own URDF, from the configuration's folder. Without it the URDF is made from
    the configuration (``chefbotd.settings.urdf``).
    """

    name: str = Field(default="chefbot", min_length=1)
    """The robot's name, on the page, in recordings and for fleets."""
    wire: str = "classic"
    description: Path | None = None

    @field_validator("wire")
    @classmethod
    def _is_spoken(cls, wire: str) -> str:
        if wire not in wires():
            raise ValueError(f"should be one of {', '.join(wires())}")
        return wire


class LogParameters(Parameters):
    """The lowest level that is logged."""

    level: Level = "info"
    """The least severe messages that are logged."""


P = TypeVar("P", bound=Parameters)


class Scanner(Protocol):
    """A sensor that sees as a lidar does, of a component: its name, and what kind of sensor it is, in words.

    One that ``guards`` has the obstacle guard slow the robot for what it sees. One that is ``blind_near`` does not see
    what is next to it, so that a point which it has lost there still counts.
    """

    @property
    def name(self) -> str:
        """Its name in topics and messages."""
        ...

    @property
    def kind(self) -> str:
        """What it is, in words."""
        ...

    @property
    def guards(self) -> bool:
        """Whether the obstacle guard slows for what it sees."""
        ...

    @property
    def blind_near(self) -> bool:
        """Whether it does not see what is next to it."""
        ...

    @property
    def band_m(self) -> tuple[float, float]:
        """The nearest and the farthest range that is seen."""
        ...


class CoreSettings(Parameters):
    """The whole configuration, one section per part of the robot.

    ``strangers`` are the components of others that it allows (``chefbotd.installed.Installed``), each as it was found.
    """

    strangers: ClassVar[tuple[Any, ...]] = ()

    robot: RobotParameters
    link: LinkParameters
    chassis: ChassisParameters
    body: BodyParameters | None = None
    encoders: EncoderParameters
    quadrature: QuadratureParameters = section()
    same_side: SameSideParameters = section()
    drive: DriveParameters
    pid: PidParameters
    wheel_pid: Mapping[str, PidParameters] = {}
    limits: MotionLimits
    odometry: OdometryParameters = section()
    control: ControlParameters = section()
    safety: SafetyParameters = section()
    latch: LatchParameters = section()
    watchdog: WatchdogParameters = section()
    ultrasonic: UltrasonicParameters | None = None
    infrared: tuple[InfraredParameters, ...] = ()
    lidar: tuple[LidarParameters, ...] = ()
    imu: ImuParameters | None = None
    battery: BatteryParameters | None = None
    api: ApiParameters = section()
    page: PageParameters = section()
    plugins: PluginsParameters = section()
    log: LogParameters = section()

    @field_validator("wheel_pid")
    @classmethod
    def _of_known_wheels(
        cls, gains: Mapping[str, PidParameters], info: ValidationInfo
    ) -> Mapping[str, PidParameters]:
        chassis: ChassisParameters | None = info.data.get("chassis")
        unknown = gains.keys() - {wheel.name for wheel in chassis.wheels} if chassis else ()
        if unknown:
            raise ValueError(f"the chassis has no wheel {', '.join(sorted(unknown))}")
        return gains

    def range_mounts(self) -> dict[str, Pose2D]:
        """The mount of each range sensor, by its name: ``base_from_sensor``."""
        sensors = (*((self.ultrasonic,) if self.ultrasonic else ()), *self.infrared)
        return {sensor.name: sensor.base_from_sensor for sensor in sensors}

    def of(self, name: str, kind: type[P]) -> P:
        """The section of a component, which is of this class."""
        section_of_component = getattr(self, name)
        if not isinstance(section_of_component, kind):
            raise TypeError(f"[{name}] is no {kind.__name__}, but {section_of_component!r}")
        return section_of_component

    @property
    def first_scanner(self) -> str | None:
        """The scanner whose scans stand for the robot's."""
        names = [lidar.name for lidar in self.lidar] + [scanner.name for scanner in self.further_scanners]
        return names[0] if names else None

    @property
    def further_scanners(self) -> tuple[Scanner, ...]:
        """What sees as a lidar does, of components."""
        return tuple(
            scanner
            for component in own_components()
            if component.scanners is not None
            for scanner in component.scanners(getattr(self, component.key))
        )

    @property
    def wheelbase_m(self) -> float:
        """How far the wheels of a side are spread along the robot; 0 where no component knows that."""
        known_m = [
            component.wheelbase_m(getattr(self, component.key))
            for component in own_components()
            if component.wheelbase_m is not None
        ]
        return known_m[0] if known_m else 0.0

    @property
    def body_size_m(self) -> tuple[float, float | None] | None:
        """The body's length and width, or its diameter and None; None where no body is configured."""
        return None if self.body is None else (self.body.length_m, self.body.width_m)

    def gains(self) -> dict[str, PidParameters]:
        """Each wheel's gains by its name, in the chassis' order: ``[wheel_pid.NAME]``, or else ``[pid]``."""
        return {wheel.name: self.wheel_pid.get(wheel.name, self.pid) for wheel in self.chassis.wheels}


if TYPE_CHECKING:
    Settings: TypeAlias = CoreSettings
else:
    Settings = with_sections(CoreSettings, own_components())
