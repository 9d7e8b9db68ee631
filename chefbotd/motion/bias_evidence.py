"""What the wheels say of a gyroscope's bias while the robot moves: the two turns of a second, compared.

It is weak evidence. What a calibration leaves of the wheels is the same in every second, so seconds are not independent:
each counts as one of ``SHARED``, and the evidence of a minute is no more certain than those errors allow.
"""

from typing import Final

from chefbotd.core.record import Record
from chefbotd.motion.motion_filter import Considered, MotionEstimate, with_bias

EVIDENCE_S: Final = 1.0
SHARED: Final = 60.0
LEAST_RAD: Final = 0.01
"""What the turn of a second may be off by small slips and by the times of the samples; assumed."""


class BiasEvidence(Record, frozen=True):
    """The turns by gyroscope and wheels (rad), the travel (m), and the time in which they were made (s)."""

    by_gyro_rad: float = 0.0
    by_wheels_rad: float = 0.0
    travel_m: float = 0.0
    lasted_s: float = 0.0

    def joined(self, other: "BiasEvidence") -> "BiasEvidence":
        """Both, one after the other."""
        return BiasEvidence(
            self.by_gyro_rad + other.by_gyro_rad,
            self.by_wheels_rad + other.by_wheels_rad,
            self.travel_m + other.travel_m,
            self.lasted_s + other.lasted_s,
        )


NO_EVIDENCE: Final = BiasEvidence()


def with_evidence(
    state: MotionEstimate, seen: BiasEvidence, wheels: Considered, variances: tuple[float, float]
) -> MotionEstimate:
    """The state corrected by the evidence.

    ``wheels`` are the variances of what is constant about the wheels and the scale of the gyroscope; ``variances`` are
    those of the wheels' turn, per metre of each side (rad²/m) and per radian (rad²/rad).
    """
    turn_rad, travel_m = seen.by_wheels_rad, seen.travel_m
    constant = (wheels.turn + wheels.imu_heading) * turn_rad**2 + wheels.turn_per_m * travel_m**2
    rolled = 2 * variances[0] * abs(travel_m) + variances[1] * abs(turn_rad)
    variance = (constant * SHARED + rolled + LEAST_RAD**2) / seen.lasted_s**2
    return with_bias(state, (seen.by_gyro_rad - turn_rad) / seen.lasted_s, variance)
