"""The section ``[sim]`` of a configuration."""

from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters, section
from chefbotd.sim_parameters.battery import BatteryParameters
from chefbotd.sim_parameters.motor import BodyParameters, MotorParameters
from chefbotd.sim_parameters.sensors import ImuParameters, UltrasonicParameters
from chefbotd.sim_parameters.sketches import BoardParameters


class WorldParameters(Parameters):
    """Where the robot starts (``world_from_base``), and between which walls; no map is the furnished room."""

    map_path: Path | None = None
    start_x_m: float = 0.0
    start_y_m: float = 0.0
    start_heading_rad: float = 0.0


class SimulationParameters(Parameters):
    """What only a simulation needs to be told of a robot; the defaults are the published one in a furnished room."""

    seed: int = Field(1, ge=0)
    step_s: float = Field(0.005, gt=0, le=0.02)
    motor: MotorParameters = section()
    body: BodyParameters = section()
    world: WorldParameters = section()
    ultrasonic: UltrasonicParameters = section()
    imu: ImuParameters = section()
    battery: BatteryParameters = section()
    board: BoardParameters = section()
