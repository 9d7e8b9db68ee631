"""Limits a step of the wheels' controller while the board takes no faster commands.

Commands are being held back, so the controller must not go on from them: the setpoints stand still, and no integral
grows. Slowing down goes on as always.
"""

from collections.abc import Sequence

from chefbotd.core.geometry import Twist2D
from chefbotd.core.record import replace
from chefbotd.motion.drive_state import DriveState
from chefbotd.motion.limits import LimiterState

Duty = tuple[int, ...]


def under(ceiling: Duty | None, before: DriveState, after: DriveState) -> DriveState:
    """The step ``after``, with no wheel driven harder than ``ceiling``, or backwards (None: no such limit)."""
    if ceiling is None:
        return after
    duty = tuple([_cut(wanted, most) for wanted, most in zip(after.duty, ceiling, strict=True)])
    slows = _slows(before.limiter.twist, after.limiter.twist)
    if not slows and _rises(before.setpoint_m_s, after.setpoint_m_s):
        after = replace(
            after,
            limiter=LimiterState(before.limiter.twist),
            setpoint_m_s=before.setpoint_m_s,
            acceleration_m_s2=(0.0,) * len(duty),
        )
    pids = [
        new if given == wanted else old
        for new, old, given, wanted in zip(after.pids, before.pids, duty, after.duty, strict=True)
    ]
    return replace(after, duty=duty, pids=tuple(pids))


def _slows(before: Twist2D, after: Twist2D) -> bool:
    """Whether the robot as a whole slows down. On the inside of a curve a wheel may speed up for that."""
    pairs = ((before.linear_m_s, after.linear_m_s), (before.angular_rad_s, after.angular_rad_s))
    return before != after and all(new * old >= 0 and abs(new) <= abs(old) for old, new in pairs)


def _cut(wanted: int, most: int) -> int:
    if wanted * most <= 0:
        return 0
    return wanted if abs(wanted) <= abs(most) else most


def _rises(before: Sequence[float], after: Sequence[float]) -> bool:
    """Whether a wheel is asked to turn faster, or the other way."""
    return any(new * old < 0 or abs(new) > abs(old) for old, new in zip(before, after, strict=True))
