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
from chefbotd.core.record import Record
from chefbotd.link.board_clock import BoardClock
from firmware_protocol import messages as wire

Reading = Callable[[Any, float], Record | None]
"""The event that a frame stands for, from when its bytes were read; None where it stands for none."""


def readings(clock: BoardClock) -> Mapping[type[Any], Reading]:
    """How each frame of a sensor becomes its measurement: made as long before it was read as the clock's last line."""
    return {
        wire.UltrasonicDistance: lambda frame, s: UltrasonicEchoed(s - clock.late_s, s, frame.distance_cm),
        wire.Orientation: lambda frame, s: OrientationReported(
            s - clock.late_s, s, frame.x, frame.y, frame.z, frame.w
        ),
        wire.RawImu: lambda frame, s: InertialCounted(
            s - clock.late_s, s, frame.acceleration, frame.angular_rate
        ),
        wire.BatteryLevel: lambda frame, s: BatteryCounted(s - clock.late_s, s, frame.adc),
        wire.AnalogueLevel: lambda frame, s: AnalogueCounted(s - clock.late_s, s, frame.channel, frame.adc),
        wire.Text: lambda frame, s: TextReceived(s, frame.text),
    }


def refusal(line: wire.Malformed, now_s: float) -> LineRefused:
    """The event of a line that is no frame."""
    return LineRefused(now_s, line.reason, line.line, line.detail)
