"""The events on the bus, each named in the past tense.

``stamp_s`` is when it happened, on the host's monotonic clock. Of a measurement that is when it was made: the board's
time, mapped to the host's clock, or the time of reading where the board does not tell its time. ``arrival_s``, beside it
in every measurement, is when its bytes were read, never before ``stamp_s``: by it the guards tell whether a sensor is
silent. ``board_s`` is the board's own time, unwrapped, in seconds; only differences of it mean anything.
"""

from chefbotd.core.events.board import (
    AnalogueCounted,
    BatteryCounted,
    BoardResetProgressed,
    BoardRestarted,
    Direction,
    DutyEchoed,
    DutyWritten,
    EdgeBurst,
    EdgesSeen,
    EncodersCounted,
    InertialCounted,
    LineRefused,
    LineSeen,
    LinkClosed,
    LinkHealthChanged,
    LinkNotOpened,
    LinkOpened,
    OrientationReported,
    TextReceived,
    UltrasonicEchoed,
)
from chefbotd.core.events.robot import (
    BatteryLevelStatus,
    BatteryMeasured,
    ControlChanged,
    ImuMeasured,
    OdometryReset,
    OdometryUpdated,
    RangeMeasured,
    RangeStatus,
    SafetyChanged,
    TruthSimulated,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.events.stats import StatsSampled

__all__ = [
    "AnalogueCounted",
    "BatteryCounted",
    "BatteryLevelStatus",
    "BatteryMeasured",
    "BoardResetProgressed",
    "BoardRestarted",
    "ControlChanged",
    "Direction",
    "DutyEchoed",
    "DutyWritten",
    "EdgeBurst",
    "EdgesSeen",
    "EncodersCounted",
    "ImuMeasured",
    "InertialCounted",
    "LineRefused",
    "LineSeen",
    "LinkClosed",
    "LinkHealthChanged",
    "LinkNotOpened",
    "LinkOpened",
    "OdometryReset",
    "OdometryUpdated",
    "OrientationReported",
    "RangeMeasured",
    "RangeStatus",
    "SafetyChanged",
    "StatsSampled",
    "TextReceived",
    "TruthSimulated",
    "UltrasonicEchoed",
    "WheelsDriven",
    "WheelsMeasured",
]
