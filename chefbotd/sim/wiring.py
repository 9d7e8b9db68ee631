"""What a simulated board is connected to."""

from dataclasses import dataclass

from chefbotd.sim.battery import Divider
from chefbotd.sim.chassis import Chassis
from chefbotd.sim.infrared import Infrared
from chefbotd.sim.robot import Robot
from chefbotd.sim.sensors import Ultrasonic
from chefbotd.sim_parameters.sensors import ImuParameters
from firmware_protocol.codec import Variant


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the board is connected to, and the variant of the lines that it speaks."""

    robot: Robot
    chassis: Chassis
    ultrasonic: Ultrasonic | None
    imu: ImuParameters | None
    divider: Divider
    variant: Variant
    infrared: tuple[Infrared, ...] = ()
