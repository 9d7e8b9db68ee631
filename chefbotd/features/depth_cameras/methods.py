"""Depth cameras: the models of the topic ``depth_cameras``. Loads no numpy: the client reads these."""

from pydantic import Field

from chefbotd.rpc.models import TopicData


class DepthCameraData(TopicData):
    """One depth camera."""

    camera: str
    healthy: bool = Field(description="whether it sends images")
    reason: str = Field(description="why it does not")
    stamp_s: float = Field(description="since when that is so")


class DepthCamerasData(TopicData):
    """The health of each depth camera; its scans are on the topic ``scan``."""

    cameras: tuple[DepthCameraData, ...]
