"""What is asked of single wheels, by speed or by duty, as a motion that can be commanded."""

from collections.abc import Mapping, Sequence
from operator import truediv

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import WheelDuties, WheelVelocities
from chefbotd.core.sentence import Sentence
from chefbotd.motion import rims
from chefbotd.motion.drive_state import LOADED_SHARE, DriveParameters
from chefbotd.motion.kinematics import Kinematics
from chefbotd.motion.limits import MotionLimits


def by_duty(
    duties: WheelDuties,
    names: Sequence[str],
    parameters: DriveParameters,
    kinematics: Kinematics,
    limits: MotionLimits,
) -> WheelVelocities:
    """A duty for each wheel: all reduced in proportion to what the limits of speed allow.

    A wheel is taken to turn as fast as a free motor of that duty, in proportion to the highest speed. Raises
    ``ValueError`` unless there is a duty for each wheel.
    """
    if len(duties.duty) != len(names):
        raise ValueError(f"expected a duty for each of {', '.join(names)}, got {duties.duty}")
    per_duty_m_s = parameters.max_rim_speed_m_s / LOADED_SHARE / parameters.max_duty
    rims_m_s = [duty * per_duty_m_s for duty in duties.duty]
    twist = kinematics.twist(tuple(map(truediv, rims_m_s, kinematics.radii_m)))
    share = rims.share_of(limits, parameters.max_rim_speed_m_s, rims_m_s, twist)
    duty = tuple([int(value * share) for value in duties.duty])
    speeds = zip(duty, kinematics.radii_m, strict=True)
    rad_s = tuple([value * per_duty_m_s / radius_m for value, radius_m in speeds])
    return WheelVelocities(rad_s, kinematics.twist(rad_s), duty)


def by_speed(
    velocity_rad_s: Mapping[str, float], names: Sequence[str], kinematics: Kinematics
) -> WheelVelocities:
    """A speed for each named wheel; the other wheels stand.

    Raises:
        Refused: there is no wheel of such a name.
    """
    strangers = [name for name in velocity_rad_s if name not in names]
    if strangers:
        reason = Sentence(
            "driving.unknown_wheel",
            "no wheel named {wheels}; there are {others}",
            wheels=", ".join(map(ascii, strangers)),
            others=", ".join(names),
        )
        raise Refused(RefusalKind.UNKNOWN_WHEEL, reason)
    speeds = tuple([velocity_rad_s.get(name, 0.0) for name in names])
    return WheelVelocities(speeds, kinematics.twist(speeds))
