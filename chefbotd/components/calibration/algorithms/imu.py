"""The step ``imu``: a gyroscope's bias and scale, the lag of its readings, and where the IMU's x axis points.

The robot stands, turns both ways on the spot, and drives to and fro. The headings of a board, or the sum of its rates,
are fitted to the turns by the wheels; where a lidar looks on, to what it sees from stop to stop (``imu_fit``).
"""

from chefbotd.components.calibration.algorithms.imu_fit import NAME, fit_imu
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Move, Procedure, StepDefinition
from chefbotd.core.geometry import Twist2D

SPACE_M = 0.35
REST_S, LOOK_S = 12.0, 1.2
TURN_RAD_S = (0.6, 1.2, 0.9)
TURN_RAD = 7.0
JOG_M_S, JOG_S, JOGS = 0.25, 0.8, 4


def _missing(robot: ConfiguredRobot) -> str:
    return "" if robot.imu is not None else "the robot has no IMU"


def _procedure(robot: ConfiguredRobot) -> Procedure:
    fastest_rad_s = 1.8 * robot.drive.max_rim_speed_m_s / robot.chassis.effective_track_m
    fastest_rad_s = min(fastest_rad_s, robot.limits.angular.axis.max_forward)
    yield Move(None, REST_S, "stands, so that the bias shows")
    for k, rate in enumerate(TURN_RAD_S):
        rate_rad_s = min(rate, fastest_rad_s)
        for sign in (1, -1):
            done = 0.3 + 0.15 * k + (0.07 if sign < 0 else 0.0)
            yield Move(Twist2D(0.0, sign * rate_rad_s), TURN_RAD / rate_rad_s, "turns", done)
            yield Move(None, LOOK_S, "looks around", done)
    speed_m_s = min(JOG_M_S, 0.8 * robot.drive.max_rim_speed_m_s)
    for k in range(JOGS):
        for sign in (1, -1):
            yield Move(Twist2D(sign * speed_m_s), JOG_S, "drives to and fro", 0.75 + 0.05 * k)


IMU = StepDefinition(
    NAME,
    "gyroscope's scale and bias, the lag of its readings, and the mount's heading",
    "Put the robot on the floor where it will drive. The wheels must be calibrated.",
    SPACE_M,
    _missing,
    _procedure,
    fit_imu,
)
