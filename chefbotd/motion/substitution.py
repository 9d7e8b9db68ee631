"""How a wheel is driven whose reading is not believed: like its substitute, a believed wheel of the same side.

The speed of the substitute closes the loop of both. If the wheel that is not believed turns faster than the
substitute, its speed counts, up to the setpoint. So if the choice was wrong, the side is not driven past its setpoint
because of a reading that is too small. And if the wheel only slips, the side is not braked, which would turn the
robot.
"""

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

Substitutes = Sequence[tuple[int, int]]
"""Pairs of indices: a wheel that is not believed, and its substitute."""


def substituted(substitutes: Substitutes, values: Sequence[T]) -> tuple[T, ...]:
    """One value per wheel; a wheel that is not believed has its substitute's."""
    replaced = list(values)
    for wheel, substitute in substitutes:
        replaced[wheel] = values[substitute]
    return tuple(replaced)


def loop_speeds(
    substitutes: Substitutes, speeds_m_s: Sequence[float], setpoints_m_s: Sequence[float]
) -> tuple[float, ...]:
    """The rim speed in m/s that each wheel's controller uses."""
    believed_m_s = list(speeds_m_s)
    for wheel, substitute in substitutes:
        setpoint_m_s = setpoints_m_s[substitute]
        faster = max if setpoint_m_s >= 0 else min
        slower = min if setpoint_m_s >= 0 else max
        believed_m_s[substitute] = faster(believed_m_s[substitute], slower(speeds_m_s[wheel], setpoint_m_s))
    return substituted(substitutes, believed_m_s)
