"""Frames that become an event as they stand: what the sensors on the board report."""

from collections.abc import Callable, Mapping
from typing import Any

from chefbotd.core.events import (
    AnalogueCounted,
    BatteryCounted,
    InertialCounted,
    LineRefused,
    OrientationReported,
    UltrasonicEchoed,
)
from chefbotd.core.record import Record
from firmware_protocol import messages as wire

READINGS: Mapping[type[Any], tuple[type[Record], Callable[[Any, float, float], Record]]] = {
    wire.UltrasonicDistance: (
        UltrasonicEchoed,
        lambda frame, stamp_s, arrival_s: UltrasonicEchoed(stamp_s, arrival_s, frame.distance_cm),
    ),
    wire.Orientation: (
        OrientationReported,
        lambda frame, stamp_s, arrival_s: OrientationReported(
            stamp_s, arrival_s, frame.x, frame.y, frame.z, frame.w
        ),
    ),
    wire.RawImu: (
        InertialCounted,
        lambda frame, stamp_s, arrival_s: InertialCounted(
            stamp_s, arrival_s, frame.acceleration, frame.angular_rate
        ),
    ),
    wire.BatteryLevel: (
        BatteryCounted,
        lambda frame, stamp_s, arrival_s: BatteryCounted(stamp_s, arrival_s, frame.adc),
    ),
    wire.AnalogueLevel: (
        AnalogueCounted,
        lambda frame, stamp_s, arrival_s: AnalogueCounted(stamp_s, arrival_s, frame.channel, frame.adc),
    ),
}
"""The measurement that each frame becomes, and how: from when it was made and when its bytes were read."""


def refusal(line: wire.Malformed, now_s: float) -> LineRefused:
    """The event of a line that is no frame."""
    return LineRefused(now_s, line.reason, line.line, line.detail)
