"""What has happened: the events on the bus, each named in the past tense.

``stamp_s`` is the host's monotonic time at which the bytes behind the event were read (or, where there were none, at
which it happened). ``board_s`` is the board's own time, unwrapped, in seconds; only differences of it mean anything.
"""

from chefbotd.core.events.board import (
    AnalogueCounted,
    BatteryCounted,
    BoardRestarted,
    Direction,
    DutyEchoed,
    EdgeBurst,
    EdgesSeen,
    EncodersCounted,
    InertialCounted,
    LineRefused,
    LineSeen,
    LinkClosed,
    LinkJudged,
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
    "BoardRestarted",
    "ControlChanged",
    "Direction",
    "DutyEchoed",
    "EdgeBurst",
    "EdgesSeen",
    "EncodersCounted",
    "ImuMeasured",
    "InertialCounted",
    "LineRefused",
    "LineSeen",
    "LinkClosed",
    "LinkJudged",
    "LinkNotOpened",
    "LinkOpened",
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
