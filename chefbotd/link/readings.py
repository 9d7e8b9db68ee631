"""Frames that become an event as they stand: what the sensors on the board report."""

from collections.abc import Callable, Mapping
from typing import Any

from chefbotd.core.events import (
    AnalogueCounted,
    BatteryCounted,
    InertialCounted,
    LineRefused,
    OrientationReported,
    TextReceived,
    UltrasonicEchoed,
)
from firmware_protocol import messages as wire

READINGS: Mapping[type[Any], Callable[[Any, float], object]] = {
    wire.UltrasonicDistance: lambda frame, now_s: UltrasonicEchoed(now_s, frame.distance_cm),
    wire.Orientation: lambda frame, now_s: OrientationReported(now_s, frame.x, frame.y, frame.z, frame.w),
    wire.RawImu: lambda frame, now_s: InertialCounted(now_s, frame.acceleration, frame.angular_rate),
    wire.BatteryLevel: lambda frame, now_s: BatteryCounted(now_s, frame.adc),
    wire.AnalogueLevel: lambda frame, now_s: AnalogueCounted(now_s, frame.channel, frame.adc),
    wire.Text: lambda frame, now_s: TextReceived(now_s, frame.text),
    wire.ResetDone: lambda _, now_s: TextReceived(now_s, "Reset Done"),
}
"""The event of each frame, stamped with the host time at which it was read."""


def refusal(line: wire.Malformed, now_s: float) -> LineRefused:
    """The event of a line that is no frame."""
    return LineRefused(now_s, line.reason, line.line, line.detail)
