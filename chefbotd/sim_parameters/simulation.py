"""The section ``[sim]`` of a configuration."""

from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters, section
from chefbotd.sim_parameters.battery import BatteryParameters
from chefbotd.sim_parameters.crowd import PersonParameters, ThingParameters
from chefbotd.sim_parameters.lidar import LidarFlaws
from chefbotd.sim_parameters.motor import BodyParameters, MotorParameters
from chefbotd.sim_parameters.sensors import ImuParameters, UltrasonicParameters
from chefbotd.sim_parameters.sketches import BoardParameters


class WorldParameters(Parameters):
    """Between which walls the robot is, and where it starts (``world_from_base``).

    ``map_path`` is a map's YAML file, or the name of a building that comes with chefbotd: ``flat`` or ``office``. No map
    is the small furnished room. A start that is left out is the building's own, and (0, 0, 0) otherwise. The doors of a
    building are open, but for those that are named in ``closed_doors``.
    """

    map_path: Path | None = None
    start_x_m: float | None = None
    start_y_m: float | None = None
    start_heading_rad: float | None = None
    closed_doors: tuple[str, ...] = ()


class SimulationParameters(Parameters):
    """What only a simulation needs to be told of a robot; the defaults are the published one in a furnished room.

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
