"""Lidars: model, port, mount, and the part of each turn that is used. Loads no numpy.

Source of the ranges: LDROBOT's LD06 and LD19 data sheets, Slamtec's A1M8 and A2M8 data sheets.
"""

import math
from enum import StrEnum

from pydantic import Field, model_validator

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters, check_device


class LidarModel(StrEnum):
    """The lidars whose bytes chefbotd reads."""

    LD06 = "ld06"
    LD19 = "ld19"
    RPLIDAR_A1 = "rplidar_a1"
    RPLIDAR_A2 = "rplidar_a2"

    @property
    def is_ldrobot(self) -> bool:
        """Whether it sends LDROBOT's packets, one way and unasked; the others speak Slamtec's protocol."""
        return self in (LidarModel.LD06, LidarModel.LD19)


RANGES_M = {
    LidarModel.LD06: (0.02, 12.0),
    LidarModel.LD19: (0.02, 12.0),
    LidarModel.RPLIDAR_A1: (0.15, 12.0),
    LidarModel.RPLIDAR_A2: (0.15, 12.0),
}
"""The nearest and the farthest reading that each model's data sheet promises."""

WEAK_BELOW = {
    LidarModel.LD06: 15,
    LidarModel.LD19: 15,
    LidarModel.RPLIDAR_A1: 5,
    LidarModel.RPLIDAR_A2: 5,
}
"""Weaker readings must have a neighbour: LDROBOT's intensity (0 to 255) and its driver's own bound; Slamtec's quality (0
to 63, assumed)."""

MAX_SECTOR_RAD = 2 * math.tau


class LidarParameters(Parameters):
    """One lidar, a ``[[lidar]]`` table each.

    ``device`` is a path (better ``/dev/serial/by-id/...``) or ``socket://host:port``. ``baud``, ``min_range_m`` and
    ``max_range_m`` are those of the model unless they are set. The mount is the position of the lidar's axis in the
    base frame; ``mount_yaw_rad`` is the direction of its zero mark, CCW seen from above, ``upside_down`` or not. Only
    the robot's description needs ``mount_z_m``, the height above the floor; the default is that of the axles.
    ``blind_sectors_rad`` are spans (from, to) of bearings that are ignored, CCW seen from above, 0 at the zero mark:
    they hide parts of the robot beside the lidar. With ``guards`` the obstacle guard slows for what the lidar sees.
    With ``express`` an RPLIDAR that offers the express scan is asked for it. A reading that is weaker than
    ``weak_below`` (None: the model's own bound; 0: none is) counts only where a beam beside it confirms it: in sunlight
    a lidar makes weak lone points.
    """

    name: str = Field(default="lidar", min_length=1, max_length=40)
    """The lidar's name in topics and messages."""
    model: LidarModel
    """Which lidar it is, which says its protocol, speed and ranges."""
    device: str = Field(min_length=1)
    baud: int | None = Field(default=None, ge=300, le=4_000_000)
    """The speed of its line; left out, the model's own."""
    exclusive: bool = True
    """The port is locked, so that no second program reads half of the bytes."""
    mount_x_m: float = Field(default=0.0, ge=-5, le=5)
    """How far ahead of the wheels' middle it is."""
    mount_y_m: float = Field(default=0.0, ge=-5, le=5)
    """How far to the left of the robot's middle it is."""
    mount_z_m: float | None = Field(default=None, ge=0, le=5)
    """Its height above the floor, for the description; left out, that of the axles."""
    mount_yaw_rad: float = Field(default=0.0, ge=-math.tau, le=math.tau)
    """Where its zero mark points, counter-clockwise from straight ahead, seen from above."""
    upside_down: bool = False
    """It hangs head down."""
    blind_sectors_rad: tuple[tuple[float, float], ...] = ()
    min_range_m: float | None = Field(default=None, gt=0, le=100)
    """Nearer readings are left out; not set, the model's own."""
    max_range_m: float | None = Field(default=None, gt=0, le=200)
    """Farther readings are left out; not set, the model's own."""
    guards: bool = True
    express: bool = True
    weak_below: int | None = Field(default=None, ge=0, le=256)

    @model_validator(mode="after")
    def _is_a_lidar(self) -> "LidarParameters":
        try:
            check_device(self.device, "/dev/ttyUSB0")
        except ValueError as error:
            raise ValueError(f"device: {error}") from None
        for begin, end in self.blind_sectors_rad:
            if max(abs(begin), abs(end)) > MAX_SECTOR_RAD or begin == end:
                raise ValueError(
                    "blind_sectors_rad are spans (from, to) in radians, CCW, of different values between "
                    f"-{MAX_SECTOR_RAD:.4g} and {MAX_SECTOR_RAD:.4g}, got ({begin:g}, {end:g})"
                )
        nearest_m, farthest_m = self.band_m
        if nearest_m >= farthest_m:
            raise ValueError(f"min_range_m must be below max_range_m, got {nearest_m:g} and {farthest_m:g}")
        return self

    @property
    def base_from_lidar(self) -> Pose2D:
        """The lidar's mount; its zero mark is along its own x axis."""
        return Pose2D(self.mount_x_m, self.mount_y_m, self.mount_yaw_rad)

    @property
    def weakest(self) -> int:
        """A reading must be so strong to count without a neighbour."""
        return WEAK_BELOW[self.model] if self.weak_below is None else self.weak_below

    @property
    def band_m(self) -> tuple[float, float]:
        """The nearest and the farthest reading that is used."""
        nearest_m, farthest_m = RANGES_M[self.model]
        return self.min_range_m or nearest_m, self.max_range_m or farthest_m
