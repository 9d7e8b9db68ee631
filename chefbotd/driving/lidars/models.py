"""Lidars: the models of the topics ``scan`` and ``lidars``. Loads no numpy: the client reads these."""

from typing import Annotated, Literal

from msgspec import Meta

from chefbotd.core.record import Record


class ScanData(Record, frozen=True):
    """A whole turn of a lidar, in the order in which it was measured; its stamp is that of its last beam.

    Bearings are counter-clockwise in the lidar's frame, 0 along its zero mark: ``bearing_start_rad`` and a step for each
    further beam, or, where the beams are not evenly spaced, ``bearing_mrad`` for each.
    """

    lidar: str
    x_m: Annotated[float, Meta(description="the lidar's mount: ahead of the base,")]
    y_m: Annotated[float, Meta(description="to its left,")]
    yaw_rad: Annotated[float, Meta(description="and where its zero mark points, CCW")]
    bearing_start_rad: float
    bearing_step_rad: Annotated[float | None, Meta(description="null where the beams are not evenly spaced")]
    bearing_mrad: Annotated[tuple[int, ...] | None, Meta(description="null where they are")]
    range_mm: Annotated[tuple[int, ...], Meta(description="0: no reading")]
    duration_s: Annotated[float, Meta(description="from the first beam to the last")]


class LidarData(Record, frozen=True):
    """One lidar and its link; ``reason`` says why it is down, or up and not healthy."""

    lidar: str
    model: str
    device: str
    state: Literal["up", "down"]
    healthy: Annotated[bool | None, Meta(description="whether it measures; null until it is known")]
    condition: Annotated[
        str,
        Meta(
            description="healthy, silent, wrong_baud, wrong_device, motor_stalled, frozen, device_error, unknown or down"
        ),
    ]
    reason: str
    stamp_s: Annotated[float, Meta(description="since when that is so")]


class LidarsData(Record, frozen=True):
    """The health of each lidar."""

    lidars: tuple[LidarData, ...]
