"""Events of lidars and depth cameras. Loads no numpy; only code that makes or reads a scan does."""

from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Level, LogLine, Record
from chefbotd.core.scan import LaserScan
from chefbotd.core.sentence import Sentence


class ScanMeasured(Record, frozen=True):
    """A whole turn of the lidar ``lidar``, which is mounted at ``base_from_lidar``; readings that are none are 0.

    ``stamp_s`` is the host's monotonic time, as is the scan's own stamp: when its last beam was measured.
    """

    drawn_as: ClassVar[str] = "scan"

    stamp_s: float
    lidar: str
    base_from_lidar: Pose2D
    scan: LaserScan


class LidarChanged(Record, frozen=True):
    """A lidar's port was opened, was lost or cannot be opened, or its condition has changed.

    ``condition`` is its stable name (``down``, ``unknown``, ``healthy``, ``silent``, ...), ``reason`` for people (empty:
    healthy). ``healthy`` is None until it can be told.
    """

    retained: ClassVar[bool] = True

    stamp_s: float
    lidar: str
    device: str
    is_open: bool
    healthy: bool | None
    condition: str
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO if self.healthy else Level.WARNING, self.lidar, self.reason or self.condition
        )


class DepthCameraChanged(Record, frozen=True):
    """A depth camera has begun to send images, or has stopped."""

    retained: ClassVar[bool] = True

    stamp_s: Annotated[float, Meta(description="since when that is so")]
    camera: str
    healthy: Annotated[bool, Meta(description="whether it sends images")]
    reason: Annotated[str, Meta(description="why it does not")]

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO if self.healthy else Level.WARNING,
            self.camera,
            self.reason or Sentence("log.sends_images", "sends images"),
        )
