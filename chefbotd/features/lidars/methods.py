"""Lidars: the models of the topics ``scan`` and ``lidars``. Loads no numpy: the client reads these."""

from typing import Literal

from pydantic import Field

from chefbotd.rpc.models import TopicData


class ScanData(TopicData):
    """A whole turn of a lidar, in the order in which it was measured; its stamp is that of its last beam.

    Bearings are counter-clockwise in the lidar's frame, 0 along its zero mark: ``bearing_start_rad`` and a step for each
    further beam, or, where the beams are not evenly spaced, ``bearing_mrad`` for each.
    """

    lidar: str
    x_m: float = Field(description="the lidar's mount: ahead of the base,")
    y_m: float = Field(description="to its left,")
    yaw_rad: float = Field(description="and where its zero mark points, CCW")
    bearing_start_rad: float
    bearing_step_rad: float | None = Field(description="null where the beams are not evenly spaced")
    bearing_mrad: tuple[int, ...] | None = Field(description="null where they are")
    range_mm: tuple[int, ...] = Field(description="0: no reading")
    duration_s: float = Field(description="from the first beam to the last")


class LidarData(TopicData):
    """One lidar and its link; ``reason`` says why it is down, or up and not healthy."""

    lidar: str
    model: str
    device: str
    state: Literal["up", "down"]
    healthy: bool | None = Field(description="whether it measures; null until it is known")
    condition: str = Field(
        description="healthy, silent, wrong_baud, wrong_device, motor_stalled, frozen, device_error, unknown or down"
    )
    reason: str
    stamp_s: float = Field(description="since when that is so")


class LidarsData(TopicData):
    """The health of each lidar."""

    lidars: tuple[LidarData, ...]
