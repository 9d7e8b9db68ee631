"""The flaws of the simulated lidars, and the effects of surfaces on their beams."""

from enum import StrEnum

from pydantic import Field

from chefbotd.core.parameters import Parameters


class ExpressScan(StrEnum):
    """What a simulated RPLIDAR makes of a request for the express scan.

    ``offered``: it sends one. ``promised``: its firmware is one that should, but nothing comes. ``absent``: its firmware
    is older than the express scan.
    """

    OFFERED = "offered"
    PROMISED = "promised"
    ABSENT = "absent"


class LidarFlaws(Parameters):
    """An LD19: 4500 points/s at about ten turns a second, with a noise of a centimetre (LDROBOT's data sheet).

    The motor's rate is off by ``rate_error_share`` (a standard deviation, drawn once) and varies by
    ``rate_wobble_share`` within ``wobble_s``; a share of the beams is lost. Glass returns a beam whose cosine to the
    pane's normal is above ``glass_square``, and lets others through. A black surface is seen from ``black_range_m`` at
    most. The USB converter hands over what has come every ``handover_s``. The shares, glass and black are assumed.
    ``height_m`` is the height of a lidar without a ``mount_z_m`` of its own.
    """

    turns_per_s: float = Field(10.0, ge=2, le=20)
    points_per_s: float = Field(4500.0, ge=500, le=20_000)
    noise_m: float = Field(0.01, ge=0, le=0.5)
    lost_share: float = Field(0.01, ge=0, le=1)
    rate_error_share: float = Field(0.003, ge=0, le=0.1)
    rate_wobble_share: float = Field(0.004, ge=0, le=0.1)
    wobble_s: float = Field(3.0, gt=0, le=100)
    min_range_m: float = Field(0.02, ge=0, le=1)
    max_range_m: float = Field(12.0, gt=0, le=60)
    glass_square: float = Field(0.97, ge=0, le=1)
    black_range_m: float = Field(4.0, ge=0, le=60)
    handover_s: float = Field(0.01, ge=0.001, le=0.1)
    express: ExpressScan = ExpressScan.OFFERED
    height_m: float = Field(0.2, gt=0, le=2.4)
