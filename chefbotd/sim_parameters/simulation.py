"""The section ``[sim]`` of a configuration."""

from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters, section
from chefbotd.sim_parameters.crowd import PersonParameters, ThingParameters
from chefbotd.sim_parameters.lidar import LidarFlaws
from chefbotd.sim_parameters.motor import BatteryParameters, BodyParameters, MotorParameters
from chefbotd.sim_parameters.sensors import ImuParameters, UltrasonicParameters
from chefbotd.sim_parameters.sketches import BoardParameters


class WorldParameters(Parameters):
    """The walls around the robot, and its start pose (``world_from_base``).

    ``map_path`` is a map's YAML file, or the name of a building that comes with chefbotd: ``flat`` or ``office``.
    Without a map it is the small furnished room. The default start is that of the building, or (0, 0, 0). The doors of
    a building are open, except those named in ``closed_doors``.
    """

    map_path: Path | None = None
    start_x_m: float | None = None
    start_y_m: float | None = None
    start_heading_rad: float | None = None
    closed_doors: tuple[str, ...] = ()


class SimulationParameters(Parameters):
    """Parameters of a robot that only a simulation needs; the defaults are the published robot in a furnished room.

    In a configuration ``world`` may be its ``map_path`` alone: ``world = "flat"``.
    """

    seed: int = Field(1, ge=0)
    step_s: float = Field(0.005, gt=0, le=0.02)
    motor: MotorParameters = section()
    body: BodyParameters = section()
    world: WorldParameters = section()
    ultrasonic: UltrasonicParameters = section()
    imu: ImuParameters = section()
    battery: BatteryParameters = section()
    board: BoardParameters = section()
    lidar: LidarFlaws = section()
    people: tuple[PersonParameters, ...] = ()
    things: tuple[ThingParameters, ...] = ()
