"""What is heard of lidars and depth cameras, apart from their scans. Loads no numpy."""

from chefbotd.core.record import Record


class LidarChanged(Record, frozen=True):
    """A lidar's port was opened, lost or cannot be opened, or what comes in on it sounds different.

    ``condition`` is its stable name (``down``, ``unknown``, ``healthy``, ``silent``, ...), ``reason`` for people (empty:
    healthy). ``healthy`` is None until it can be told.
    """

    stamp_s: float
    lidar: str
    device: str
    is_open: bool
    healthy: bool | None
    condition: str
    reason: str


class DepthCameraChanged(Record, frozen=True):
    """A depth camera sends images, or none any more; ``reason`` is for people (empty: it does)."""

    stamp_s: float
    camera: str
    healthy: bool
    reason: str
