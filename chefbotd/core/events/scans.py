"""What lidars and depth cameras saw. Not imported by the package's `__init__`: only a robot that has one loads numpy."""

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
