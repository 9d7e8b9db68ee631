"""The steps of a calibration, in the order in which each can use the results of those before."""

from collections.abc import Mapping

from chefbotd.calibration import motors
from chefbotd.calibration.by_hand import BATTERY, ENCODERS
from chefbotd.calibration.imu import IMU
from chefbotd.calibration.lidar import LIDAR
from chefbotd.calibration.sensors import SENSORS
from chefbotd.calibration.step import Step
from chefbotd.calibration.umbmark import UMBMARK
from chefbotd.calibration.wheels import WHEELS

ORDER: tuple[Step, ...] = (ENCODERS, BATTERY, motors.STEP, WHEELS, UMBMARK, LIDAR, IMU, SENSORS)

STEPS: Mapping[str, Step] = {step.name: step for step in ORDER}
