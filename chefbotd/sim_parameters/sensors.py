"""The flaws of the simulated ultrasonic sensor and IMU."""

import math

from pydantic import Field

from chefbotd.core.parameters import Parameters


class UltrasonicParameters(Parameters):
    """How well an HC-SR04 hears."""

    rays: int = Field(9, ge=1, le=361)
    min_range_m: float = Field(0.02, ge=0)
    max_range_m: float = Field(4.0, gt=0, le=20)
    noise_m: float = Field(0.002, ge=0, le=1)
    lost_echo_share: float = Field(0.0, ge=0, le=1)


class ImuParameters(Parameters):
    """An MPU-6050 with its motion processor."""

    heading_bias_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    heading_drift_rad_s: float = Field(0.0001, ge=-1, le=1)
    heading_noise_rad: float = Field(0.002, ge=0, le=1)
    gyro_bias_rad_s: float = Field(0.01, ge=-1, le=1)
    gyro_noise_rad_s: float = Field(0.001, ge=0, le=1)
    acceleration_noise_m_s2: float = Field(0.04, ge=0, le=10)
