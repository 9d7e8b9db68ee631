"""The parameters of a depth camera: its mount and its source of images. Loads no numpy."""

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, model_validator

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters


class DepthCameraParameters(Parameters):
    """A depth camera: its pinhole model, its mount on the robot, and what of its image is an obstacle.

    The mount is ``base_from_camera``: pitch is positive nose down, roll is positive right side down (REP-103, about y
    and x). Obstacles are between ``min_height_m`` and ``max_height_m`` above the floor, and as far as the two ranges.
    """

    width: int = Field(640, ge=2, le=4096)
    """The width of its images in pixels."""
    height: int = Field(480, ge=2, le=4096)
    """The height of its images in pixels."""
    focal_x_px: float = Field(585.0, gt=0)
    """The focal length across, in pixels."""
    focal_y_px: float = Field(585.0, gt=0)
    """The focal length up and down, in pixels."""
    center_x_px: float = Field(320.0, ge=0)
    """The column that looks straight ahead."""
    center_y_px: float = Field(240.0, ge=0)
    """The row that looks straight ahead."""
    mount_x_m: float = 0.0
    """How far ahead of the wheels' middle it is."""
    mount_y_m: float = 0.0
    """How far to the left of the robot's middle it is."""
    mount_height_m: float = Field(0.35, gt=0, le=3)
    """Its height above the floor."""
    mount_yaw_rad: float = Field(0.0, ge=-math.pi, le=math.pi)
    """Where it points, counter-clockwise from straight ahead."""
    mount_pitch_rad: float = Field(0.0, ge=-1.2, le=1.2)
    """How far its nose is down."""
    mount_roll_rad: float = Field(0.0, ge=-1.2, le=1.2)
    """How far its right side is down."""
    min_height_m: float = Field(0.03, gt=0)
    """What is lower is floor."""
    max_height_m: float = Field(1.0, gt=0)
    """What is higher is passed under: the robot's own height."""
    min_range_m: float = Field(0.45, gt=0)
    """Nearer points are left out."""
    max_range_m: float = Field(4.0, gt=0, le=60)
    """Farther points are left out."""
    beams: int = Field(320, ge=1, le=4096)
    """Into so many directions an image is made a scan of."""
    depth_noise_per_m: float = Field(1.425e-3, ge=0, le=0.1)
    """The noise of a depth, which grows with the square of the range."""
    floor_sigmas: ClassVar[float] = 3.0
    """So many standard deviations of its noise the floor may stick up."""
    tilt_error_rad: ClassVar[float] = 0.01
    """How far its pitch may be off, which lifts a distant floor."""
    neighbour_share: ClassVar[float] = 0.03
    """A point counts if one beside it is as far, within this share."""
    retired: ClassVar[Mapping[str, Any]] = {
        "floor_sigmas": floor_sigmas,
        "tilt_error_rad": tilt_error_rad,
        "neighbour_share": neighbour_share,
    }

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
    """The camera's name in topics and messages."""
    source: DepthSource = DepthSource.OPENNI2
    """Where its images come from: a camera through OpenNI2, or a folder of images."""
    device: str | None = Field(default=None, min_length=1)
    """OpenNI2's address of the camera; left out, the first one that is found."""
    library: Path | None = None
    """The folder of OpenNI2's library, if that is not where libraries are."""
    folder: Path | None = None
    """With the source ``folder``: the folder of images of 16 bits, played again and again."""
    pattern: str = Field(default="*.png", min_length=1)
    """The names of the images in the folder."""
    millimetres_per_unit: float = Field(default=1.0, gt=0, le=100)
    """What a unit of an image stands for."""
    rate_hz: float = Field(default=10.0, gt=0, le=60)
    """No more images a second are used."""
    silence_timeout_s: float = Field(default=3.0, ge=0.5, le=60)
    """A camera that sends nothing for so long is started again."""
    guards: bool = True

    @property
    def kind(self) -> str:
        """What it is, in words."""
        return "depth camera"

    @property
    def blind_near(self) -> bool:
        """It does not see what is nearer than ``min_range_m``."""
        return True

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
