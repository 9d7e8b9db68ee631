"""The section ``[sim]`` of a configuration, with people and things in the way, and the flaws of lidars and sensors."""

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar, Final, Self

from pydantic import Field, model_validator

from chefbotd.components.simulation.parameters.floor import FloorParameters
from chefbotd.components.simulation.parameters.motor import (
    MotorParameters,
    SimBatteryParameters,
    SimBodyParameters,
)
from chefbotd.components.simulation.parameters.sketches import BoardParameters
from chefbotd.components.simulation.parameters.true import TrueParameters
from chefbotd.core.parameters import Parameters, section


class PersonParameters(Parameters):
    """A person who walks along a path of points (x, y), back and forth or in circles, with a pause at each end.

    ``stops_for_robot``: the person stops rather than come closer to the robot than ``min_distance_m``; otherwise it
    ignores the robot.
    Speeds and pauses vary by a tenth (a standard deviation), drawn from the seed.
    """

    path_m: tuple[tuple[float, float], ...] = Field(min_length=1)
    """The points (x, y) of the way that the person walks."""
    speed_m_s: float = Field(0.8, gt=0, le=3)
    """How fast the person walks, give or take a tenth."""
    radius_m: float = Field(0.25, gt=0, le=1)
    """The radius of the person, seen from above."""
    start_m: float = Field(0.0, ge=0)
    """How far along the way the person starts."""
    pause_s: float = Field(1.0, ge=0, le=3600)
    """How long the person stands at each end."""
    stops_for_robot: bool = True
    """The person stops rather than come nearer to the robot than ``min_distance_m``."""
    min_distance_m: float = Field(0.3, ge=0, le=5)
    """The distance to the robot at which the person stops."""
    closed_path: bool = False
    """The person walks round and round instead of back and forth."""

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if self.closed_path and len(self.path_m) < 3:
            raise ValueError(f"going round needs three points at least, got {len(self.path_m)}")
        return self


class ThingParameters(Parameters):
    """A chair, a bag: something round on the floor that is on no map."""

    x_m: float
    """Where its middle is, x in the world."""
    y_m: float
    """Where its middle is, y in the world."""
    radius_m: float = Field(0.25, gt=0, le=2)
    """Its radius, seen from above."""


class ExpressScan(StrEnum):
    """What a simulated RPLIDAR makes of a request for the express scan.

    ``offered``: it sends one. ``promised``: its firmware is one that should, but nothing comes. ``absent``: its firmware
    is older than the express scan.
    """

    OFFERED = "offered"
    PROMISED = "promised"
    ABSENT = "absent"


WOBBLE_S: Final = 3.0
"""The time within which the rate of a lidar's motor varies; assumed."""

GLASS_SQUARE: Final = 0.97
"""Glass returns a beam whose cosine to the pane's normal is above this, and lets others through; assumed."""

HANDOVER_S: Final = 0.01
"""How often a lidar's USB converter hands over what has come."""

LONE_RANGE_M: Final = (0.05, 1.0)
"""Between these ranges the noise of sunlight is evenly spread; assumed."""

LONE_INTENSITY: Final = 12
"""That noise is as bright as this at most; assumed."""


class LidarFlaws(Parameters):
    """An LD19: 4500 points/s at about ten turns a second, with a noise of a centimetre (LDROBOT's data sheet).

    The motor's rate is off by ``rate_error_share`` (a standard deviation, drawn once) and varies by
    ``rate_wobble_share``; a share of the beams is lost. A black surface is seen from ``black_range_m`` at most. The
    shares and black are assumed.
    ``height_m`` is the height of a lidar without a ``mount_z_m`` of its own. A ``lone_share`` of the beams shows noise
    instead, as in sunlight.
    """

    retired: ClassVar[Mapping[str, Any]] = {
        "wobble_s": WOBBLE_S,
        "glass_square": GLASS_SQUARE,
        "handover_s": HANDOVER_S,
        "lone_range_m": list(LONE_RANGE_M),
        "lone_intensity": LONE_INTENSITY,
    }

    turns_per_s: float = Field(10.0, ge=2, le=20)
    """How fast it turns."""
    points_per_s: float = Field(4500.0, ge=500, le=20_000)
    """How many points it measures."""
    noise_m: float = Field(0.01, ge=0, le=0.5)
    """The noise of a range, one sigma."""
    lost_share: float = Field(0.01, ge=0, le=1)
    """The share of beams that bring nothing back."""
    rate_error_share: float = Field(0.003, ge=0, le=0.1)
    """By how much its motor's rate is off, drawn once (a standard deviation)."""
    rate_wobble_share: float = Field(0.004, ge=0, le=0.1)
    """By how much the rate varies."""
    min_range_m: float = Field(0.02, ge=0, le=1)
    """It reads nothing nearer."""
    max_range_m: float = Field(12.0, gt=0, le=60)
    """It reads nothing farther."""
    black_range_m: float = Field(4.0, ge=0, le=60)
    express: ExpressScan = ExpressScan.OFFERED
    """Whether an RPLIDAR offers its express scan, promises it without having it, or knows none."""
    height_m: float = Field(0.2, gt=0, le=2.4)
    lone_share: float = Field(0.0, ge=0, le=1)
    """The share of beams that show lone weak noise instead, as in sunlight."""


class SimUltrasonicParameters(Parameters):
    """How well an HC-SR04 hears.

    An echo is lost by chance (``lost_echo_share``), and with it the next ones of a burst of ``lost_echo_burst``; also
    each ``lost_echo_every``-th one (0: none). A ``far_echo_share`` of the readings is of something farther, up to the
    sensor's range.
    """

    rays: int = Field(9, ge=1, le=361)
    """So many rays of its cone are traced."""
    min_range_m: float = Field(0.02, ge=0)
    """It reads nothing nearer."""
    max_range_m: float = Field(4.0, gt=0, le=20)
    """It hears nothing farther."""
    noise_m: float = Field(0.002, ge=0, le=1)
    """The noise of a reading, one sigma."""
    lost_echo_share: float = Field(0.0, ge=0, le=1)
    """The share of echoes that are lost by chance."""
    lost_echo_burst: int = Field(1, ge=1, le=1000)
    """How many echoes in a row are lost then."""
    lost_echo_every: int = Field(0, ge=0, le=1000)
    """Each so many-th echo is lost; 0: none."""
    far_echo_share: float = Field(0.0, ge=0, le=1)


class SimInfraredParameters(Parameters):
    """A Sharp sensor's noise (one sigma, assumed), and the share of its samples that show nothing in range."""

    noise_v: float = Field(0.01, ge=0, le=1)
    """The noise of a sample, one sigma (assumed)."""
    glitch_share: float = Field(0.0, ge=0, le=1)
    """The share of samples that show nothing in range."""


class SimImuParameters(Parameters):
    """An MPU-6050 with its motion processor."""

    heading_bias_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    """By how much its heading is off at the start."""
    heading_drift_rad_s: float = Field(0.0001, ge=-1, le=1)
    """How fast its heading drifts."""
    heading_noise_rad: float = Field(0.002, ge=0, le=1)
    """The noise of its heading, one sigma."""
    gyro_bias_rad_s: float = Field(0.01, ge=-1, le=1)
    """The rate that its gyroscope shows at rest."""
    gyro_noise_rad_s: float = Field(0.001, ge=0, le=1)
    """The noise of its rates, one sigma."""
    acceleration_noise_m_s2: float = Field(0.04, ge=0, le=10)
    """The noise of its accelerations, one sigma."""


class WorldParameters(Parameters):
    """The walls around the robot, and its start pose (``world_from_base``).

    ``map_path`` is a map's YAML file, or the name of a building that comes with chefbotd: ``flat`` or ``office``.
    Without a map it is the small furnished room. The default start is that of the building, or (0, 0, 0). The doors of
    a building are open, except those named in ``closed_doors``. Simulated robots whose files ``shared_truth`` are in one
    folder (``/tmp/floor/r1.truth``) stand on one floor, seen and touched by each other.
    """

    map_path: Path | None = None
    """A map's YAML file, or a building of chefbotd's: ``flat`` or ``office``; left out, a furnished room."""
    start_x_m: float | None = None
    """Where the robot starts, x in the world; left out, the building's own start."""
    start_y_m: float | None = None
    """Where the robot starts, y in the world; left out, the building's own start."""
    start_heading_rad: float | None = None
    """The heading with which it starts, counter-clockwise; left out, the building's own."""
    closed_doors: tuple[str, ...] = ()
    """The doors of the building that are closed."""
    shared_truth: Path | None = None


class Physics(StrEnum):
    """What moves the simulated robot: our own model in the plane, or MuJoCo, which has to be installed."""

    PLANAR = "planar"
    MUJOCO = "mujoco"


class SimulationParameters(Parameters):
    """Parameters of a robot that only a simulation needs; the defaults are the published robot in a furnished room.

    In a configuration ``world`` may be its ``map_path`` alone: ``world = "flat"``.
    ``true`` is where the robot differs from the rest of the configuration. A ``floor`` with bumps and ramps needs the
    physics of MuJoCo. ``shared_clock`` is the socket of the clock that this robot shares with others, instead of the
    computer's (``python -m chefbotd.shared_clock SOCKET``).
    """

    seed: int = Field(1, ge=0)
    """What all noise and chance of the simulation is drawn from: the same seed, the same run."""
    step_s: float = Field(0.005, gt=0, le=0.02)
    """The step of the simulation."""
    physics: Physics = Physics.PLANAR
    """``planar`` is our own model of a disc in the plane, ``mujoco`` rigid bodies in three dimensions (the extra
    ``mujoco``)."""
    motor: MotorParameters = section()
    body: SimBodyParameters = section()
    true: TrueParameters = section()
    world: WorldParameters = section()
    ultrasonic: SimUltrasonicParameters = section()
    infrared: SimInfraredParameters = section()
    imu: SimImuParameters = section()
    battery: SimBatteryParameters = section()
    board: BoardParameters = section()
    lidar: LidarFlaws = section()
    people: tuple[PersonParameters, ...] = ()
    things: tuple[ThingParameters, ...] = ()
    floor: tuple[FloorParameters, ...] = ()
    shared_clock: Path | None = None

    @model_validator(mode="after")
    def _has_a_floor(self) -> Self:
        if self.floor and self.physics is not Physics.MUJOCO:
            raise ValueError(
                f"a floor that is not level needs physics = 'mujoco', got '{self.physics.value}'"
            )
        return self
