"""The scans of lidars and depth cameras. The package's `__init__` does not import them, because they need numpy."""

from dataclasses import dataclass

from chefbotd.core.geometry import Pose2D
from chefbotd.core.scan import LaserScan


@dataclass(frozen=True, slots=True)
class ScanMeasured:
    """A whole turn of the lidar ``lidar``, which is mounted at ``base_from_lidar``; readings that are none are 0.

    ``stamp_s`` is the host's monotonic time, as is the scan's own stamp: when its last beam was measured.
    """

    stamp_s: float
    lidar: str
    base_from_lidar: Pose2D
    scan: LaserScan
