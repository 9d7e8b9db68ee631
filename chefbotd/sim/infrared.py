"""The output of a Sharp GP2Y0A02YK: a voltage that rises with distance up to its fold, and falls beyond."""

import math

import numpy as np
from pydantic import Field

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.sim.battery import ADC_MAX
from chefbotd.sim.sensors import Fan
from chefbotd.sim.world import World

NEAR_M = np.array([0.00, 0.05, 0.10, 0.13, 0.15])
NEAR_V = np.array([0.50, 1.30, 2.20, 2.65, 2.75])
"""Before the fold, read off the data sheet's figure."""

FAR_M = np.array([0.15, 0.20, 0.25, 0.30, 0.40, 0.50, 0.60, 0.80, 1.00, 1.20, 1.50, 2.50])
FAR_V = np.array([2.75, 2.70, 2.40, 2.00, 1.55, 1.25, 1.03, 0.78, 0.62, 0.51, 0.40, 0.25])
"""From the fold outwards; between two points the voltage is linear in one over the distance."""


class InfraredParameters(Parameters):
    """One sensor on an analogue input of the board."""

    channel: int = Field(0, ge=0, le=15)
    mount_x_m: float = Field(0.0, ge=-5, le=5)
    mount_y_m: float = Field(0.0, ge=-5, le=5)
    mount_heading_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    field_of_view_rad: float = Field(0.1, gt=0, le=math.pi)
    rays: int = Field(3, ge=1, le=361)
    reference_v: float = Field(3.3, gt=0, le=10)
    noise_v: float = Field(0.01, ge=0, le=1)


class Infrared:
    """The sensor on the robot."""

    def __init__(self, parameters: InfraredParameters, world: World) -> None:
        self._parameters = parameters
        mount = Pose2D(parameters.mount_x_m, parameters.mount_y_m, parameters.mount_heading_rad)
        self._fan = Fan(world, mount, parameters.field_of_view_rad, parameters.rays)
        self.channel = parameters.channel

    def adc_counts(self, world_from_base: Pose2D, chance: np.random.Generator) -> int:
        """The 12-bit reading of the nearest object in its cone."""
        volts = voltage(self._fan.nearest_m(world_from_base))
        volts += float(chance.standard_normal()) * self._parameters.noise_v
        return min(max(round(volts / self._parameters.reference_v * ADC_MAX), 0), ADC_MAX)


def voltage(distance_m: float) -> float:
    """The sensor's output for a white card at this distance."""
    if distance_m <= NEAR_M[-1]:
        return float(np.interp(distance_m, NEAR_M, NEAR_V))
    return float(np.interp(1 / distance_m, 1 / FAR_M[::-1], FAR_V[::-1]))
