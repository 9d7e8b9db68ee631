"""What is heard of depth cameras, apart from their scans. Loads no numpy."""

from chefbotd.core.record import Record


class DepthCameraChanged(Record, frozen=True):
    """A depth camera sends images, or none any more; ``reason`` is for people (empty: it does)."""

    stamp_s: float
    camera: str
    healthy: bool
    reason: str
