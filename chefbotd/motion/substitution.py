"""What drives a wheel whose reading is not believed, and its mate that is: one loop, closed on the two readings.

It goes by the believed one, except that a mate which rolls on counts as far as the setpoint. So where the choice was
wrong, the side is not driven past its target for the sake of a reading that is too small; and where the other wheel
only slips, it does not brake the side: that would turn the robot.
"""

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

Led = Sequence[tuple[int, int]]
"""Wheels that are not believed, each with the one that is."""


def followed(led: Led, values: Sequence[T]) -> tuple[T, ...]:
    """What belongs to each wheel, with its leader's for a wheel that is led."""
    theirs = list(values)
    for wheel, leader in led:
        theirs[wheel] = values[leader]
    return tuple(theirs)


def heard(led: Led, speeds_m_s: Sequence[float], setpoints_m_s: Sequence[float]) -> tuple[float, ...]:
    """How fast each wheel rolls as far as its loop is concerned."""
    believed_m_s = list(speeds_m_s)
    for wheel, leader in led:
        setpoint_m_s = setpoints_m_s[leader]
        faster = max if setpoint_m_s >= 0 else min
        slower = min if setpoint_m_s >= 0 else max
        believed_m_s[leader] = faster(believed_m_s[leader], slower(speeds_m_s[wheel], setpoint_m_s))
    return followed(led, believed_m_s)
