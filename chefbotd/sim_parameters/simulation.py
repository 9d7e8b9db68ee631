"""The section ``[sim]`` of a configuration, with people and things in the way, and the flaws of lidars and sensors."""

import math
from enum import StrEnum
from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters, section
from chefbotd.sim_parameters.floor import FloorParameters
from chefbotd.sim_parameters.motor import MotorParameters, SimBatteryParameters, SimBodyParameters
from chefbotd.sim_parameters.sketches import BoardParameters
from chefbotd.sim_parameters.true import TrueParameters


class PersonParameters(Parameters):
    """A person who walks along a path of points (x, y), back and forth or in circles, with a pause at each end.

    ``stops_for_robot``: the person stops rather than come closer to the robot than ``min_distance_m``; otherwise it
    ignores the robot.
    Speeds and pauses vary by a tenth (a standard deviation), drawn from the seed.
    """

    path_m: tuple[tuple[float, float], ...] = Field(min_length=1)
    speed_m_s: float = Field(0.8, gt=0, le=3)
    radius_m: float = Field(0.25, gt=0, le=1)
    start_m: float = Field(0.0, ge=0)
    pause_s: float = Field(1.0, ge=0, le=3600)
    stops_for_robot: bool = True
    min_distance_m: float = Field(0.3, ge=0, le=5)
    closed_path: bool = False

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if self.closed_path and len(self.path_m) < 3:
            raise ValueError(f"going round needs three points at least, got {len(self.path_m)}")
        return self


class ThingParameters(Parameters):
    """A chair, a bag: something round on the floor that is on no map."""

    x_m: float
    y_m: float
    radius_m: float = Field(0.25, gt=0, le=2)


class ExpressScan(StrEnum):
    """What a simulated RPLIDAR makes of a request for the express scan.

    ``offered``: it sends one. ``promised``: its firmware is one that should, but nothing comes. ``absent``: its firmware
    is older than the express scan.
    """

    OFFERED = "offered"
    PROMISED = "promised"
    ABSENT = "absent"


class LidarFlaws(Parameters):
    """An LD19: 4500 points/s at about ten turns a second, with a noise of a centimetre (LDROBOT's data sheet).

    The motor's rate is off by ``rate_error_share`` (a standard deviation, drawn once) and varies by
    ``rate_wobble_share`` within ``wobble_s``; a share of the beams is lost. Glass returns a beam whose cosine to the
    pane's normal is above ``glass_square``, and lets others through. A black surface is seen from ``black_range_m`` at
    most. The USB converter hands over what has come every ``handover_s``. The shares, glass and black are assumed.
    ``height_m`` is the height of a lidar without a ``mount_z_m`` of its own. A ``lone_share`` of the beams shows noise
    instead, as in sunlight: evenly spread over ``lone_range_m``, as bright as ``lone_intensity`` at most.
    """

    turns_per_s: float = Field(10.0, ge=2, le=20)
    points_per_s: float = Field(4500.0, ge=500, le=20_000)
    noise_m: float = Field(0.01, ge=0, le=0.5)
    lost_share: float = Field(0.01, ge=0, le=1)
    rate_error_share: float = Field(0.003, ge=0, le=0.1)
    rate_wobble_share: float = Field(0.004, ge=0, le=0.1)
    wobble_s: float = Field(3.0, gt=0, le=100)
    min_range_m: float = Field(0.02, ge=0, le=1)
    max_range_m: float = Field(12.0, gt=0, le=60)
    glass_square: float = Field(0.97, ge=0, le=1)
    black_range_m: float = Field(4.0, ge=0, le=60)
    handover_s: float = Field(0.01, ge=0.001, le=0.1)
    express: ExpressScan = ExpressScan.OFFERED
    height_m: float = Field(0.2, gt=0, le=2.4)
    lone_share: float = Field(0.0, ge=0, le=1)
    lone_range_m: tuple[float, float] = (0.05, 1.0)
    lone_intensity: int = Field(12, ge=1, le=255)


class SimUltrasonicParameters(Parameters):
    """How well an HC-SR04 hears.

    An echo is lost by chance (``lost_echo_share``), and with it the next ones of a burst of ``lost_echo_burst``; also
    each ``lost_echo_every``-th one (0: none). A ``far_echo_share`` of the readings is of something farther, up to the
    sensor's range.
    """

    rays: int = Field(9, ge=1, le=361)
    min_range_m: float = Field(0.02, ge=0)
    max_range_m: float = Field(4.0, gt=0, le=20)
    noise_m: float = Field(0.002, ge=0, le=1)
    lost_echo_share: float = Field(0.0, ge=0, le=1)
    lost_echo_burst: int = Field(1, ge=1, le=1000)
    lost_echo_every: int = Field(0, ge=0, le=1000)
    far_echo_share: float = Field(0.0, ge=0, le=1)


class SimInfraredParameters(Parameters):
    """A Sharp sensor's noise (one sigma, assumed), and the share of its samples that show nothing in range."""

    noise_v: float = Field(0.01, ge=0, le=1)
    glitch_share: float = Field(0.0, ge=0, le=1)


class SimImuParameters(Parameters):
    """An MPU-6050 with its motion processor."""

    heading_bias_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    heading_drift_rad_s: float = Field(0.0001, ge=-1, le=1)
    heading_noise_rad: float = Field(0.002, ge=0, le=1)
    gyro_bias_rad_s: float = Field(0.01, ge=-1, le=1)
    gyro_noise_rad_s: float = Field(0.001, ge=0, le=1)
    acceleration_noise_m_s2: float = Field(0.04, ge=0, le=10)


class WorldParameters(Parameters):
    """The walls around the robot, and its start pose (``world_from_base``).

    ``map_path`` is a map's YAML file, or the name of a building that comes with chefbotd: ``flat`` or ``office``.
    Without a map it is the small furnished room. The default start is that of the building, or (0, 0, 0). The doors of
    a building are open, except those named in ``closed_doors``. Simulated robots whose files ``shared_truth`` are in one
    folder (``/tmp/floor/r1.truth``) stand on one floor, seen and touched by each other.
    """

    map_path: Path | None = None
    start_x_m: float | None = None
    start_y_m: float | None = None
    start_heading_rad: float | None = None
    closed_doors: tuple[str, ...] = ()
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
    step_s: float = Field(0.005, gt=0, le=0.02)
    physics: Physics = Physics.PLANAR
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
