"""The parameters of a depth camera: its mount and its source of images. Loads no numpy."""

import math
from enum import StrEnum
from pathlib import Path

from pydantic import Field, model_validator

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters


class DepthCameraParameters(Parameters):
    """A depth camera: its pinhole model, its mount on the robot, and what of its image is an obstacle.

    The mount is ``base_from_camera``: pitch is positive nose down, roll is positive right side down (REP-103, about y
    and x). Obstacles are between ``min_height_m`` and ``max_height_m`` above the floor, and as far as the two ranges.
    """

    width: int = Field(640, ge=2, le=4096)
    height: int = Field(480, ge=2, le=4096)
    focal_x_px: float = Field(585.0, gt=0)
    focal_y_px: float = Field(585.0, gt=0)
    center_x_px: float = Field(320.0, ge=0)
    center_y_px: float = Field(240.0, ge=0)
    mount_x_m: float = 0.0
    mount_y_m: float = 0.0
    mount_height_m: float = Field(0.35, gt=0, le=3)
    mount_yaw_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    mount_pitch_rad: float = Field(0.0, ge=-1.2, le=1.2)
    mount_roll_rad: float = Field(0.0, ge=-1.2, le=1.2)
    min_height_m: float = Field(0.03, gt=0)
    max_height_m: float = Field(1.0, gt=0)
    min_range_m: float = Field(0.45, gt=0)
    max_range_m: float = Field(4.0, gt=0, le=60)
    beams: int = Field(320, ge=1, le=4096)
    depth_noise_per_m: float = Field(1.425e-3, ge=0, le=0.1)
    floor_sigmas: float = Field(3.0, ge=0, le=10)
    tilt_error_rad: float = Field(0.01, ge=0, le=0.2)
    neighbour_share: float = Field(0.03, gt=0, le=1)

    @model_validator(mode="after")
    def _bands_are_bands(self) -> "DepthCameraParameters":
        if self.min_height_m >= self.max_height_m:
            raise ValueError(
                f"min_height_m must be below max_height_m, {self.max_height_m}, got {self.min_height_m}"
            )
        if self.min_range_m >= self.max_range_m:
            raise ValueError(
                f"min_range_m must be below max_range_m, {self.max_range_m}, got {self.min_range_m}"
            )
        if self.mount_height_m <= self.min_height_m:
            raise ValueError(
                f"the camera must be mounted above min_height_m, {self.min_height_m} m, got {self.mount_height_m}"
            )
        return self

    @property
    def base_from_camera(self) -> Pose2D:
        """The mount as seen from above: what a scan's bearings are from."""
        return Pose2D(self.mount_x_m, self.mount_y_m, self.mount_yaw_rad)


class DepthSource(StrEnum):
    """Where depth images come from: a camera through OpenNI2, or a folder of images."""

    OPENNI2 = "openni2"
    FOLDER = "folder"


class DepthSourceParameters(DepthCameraParameters):
    """One depth camera, a ``[[depth_camera]]`` table each.

    ``device`` is OpenNI2's URI (left out: the first camera that is found), ``library`` the folder of its library if that
    is not where libraries are. ``folder`` has images (16 bits; ``millimetres_per_unit`` is what a unit stands for) whose
    names match ``pattern``; they are played in their order, again and again. No more than ``rate_hz`` images are used.
    A camera that sends nothing for ``silence_timeout_s`` is started again. With ``guards`` the obstacle guard slows for
    what the camera sees.
    """

    name: str = Field(default="depth_camera", min_length=1, max_length=40)
    source: DepthSource = DepthSource.OPENNI2
    device: str | None = Field(default=None, min_length=1)
    library: Path | None = None
    folder: Path | None = None
    pattern: str = Field(default="*.png", min_length=1)
    millimetres_per_unit: float = Field(default=1.0, gt=0, le=100)
    rate_hz: float = Field(default=10.0, gt=0, le=60)
    silence_timeout_s: float = Field(default=3.0, ge=0.5, le=60)
    guards: bool = True

    @property
    def band_m(self) -> tuple[float, float]:
        """The nearest and the farthest range that is seen."""
        return self.min_range_m, self.max_range_m

    @model_validator(mode="after")
    def _has_a_source(self) -> "DepthSourceParameters":
        if (self.folder is None) == (self.source is DepthSource.FOLDER):
            problem = "needs a folder" if self.folder is None else "has no folder"
            raise ValueError(f"a camera whose source is {str(self.source)!r} {problem}")
        return self
