"""Depth cameras: the models of the topic ``depth_cameras``. Loads no numpy: the client reads these."""

from chefbotd.core.events.lidars import DepthCameraChanged
from chefbotd.core.record import Record


class DepthCamerasData(Record, frozen=True):
    """The health of each depth camera; its scans are on the topic ``scan``."""

    cameras: tuple[DepthCameraChanged, ...]
