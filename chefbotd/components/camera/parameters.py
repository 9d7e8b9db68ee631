"""The section [camera]: where pictures come from, how many and how large, and who may see them."""

from enum import StrEnum
from typing import Final

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters
from chefbotd.rpc.parameters import Role

PICTURES_IN_SILENCE: Final = 2
"""A camera that sends nothing for less than two pictures' time may only be slow."""
TOLERANCE: Final = 1e-9


class CameraSource(StrEnum):
    """Where pictures come from: a device of Video4Linux, or a program that writes Motion JPEG to its output."""

    V4L2 = "v4l2"
    COMMAND = "command"


class CameraParameters(Parameters):
    """The section [camera]. Pictures are JPEG, passed on as they come; a simulated robot draws what it sees instead.

    The camera runs while somebody looks at it, or pictures of it are recorded.
    """

    enabled: bool = False
    """The robot has a camera."""
    source: CameraSource = CameraSource.V4L2
    """A device of Video4Linux (a webcam), or a program that writes Motion JPEG."""
    device: str = Field(
        "/dev/video0", min_length=1, description="The device of Video4Linux; better /dev/v4l/by-id/..."
    )
    command: tuple[str, ...] = Field(
        (),
        description="The program and its arguments, which writes Motion JPEG to its output, such as "
        '["rpicam-vid", "--codec", "mjpeg", "--timeout", "0", "--nopreview", "--output", "-"]',
    )
    width_px: int = Field(640, ge=16, le=4096, description="The width that the device is asked for")
    height_px: int = Field(480, ge=16, le=4096, description="The height that the device is asked for")
    rate_hz: float = Field(15.0, ge=0.2, le=60.0, description="No more pictures a second are passed on")
    max_frame_bytes: int = Field(
        262_144, ge=4096, le=4_194_304, description="A longer picture is dropped, and counted"
    )
    silence_timeout_s: float = Field(
        3.0, ge=0.5, le=60.0, description="A camera that sends nothing for so long is started again"
    )
    role: Role = Field(Role.DRIVE, description="The least role that sees the picture")
    max_viewers: int = Field(10, ge=1, le=100, description="The most clients that look at a time")
    recorded_hz: float = Field(
        0.0, ge=0.0, le=10.0, description="So many pictures a second are recorded with all else; 0: none"
    )
    mount_x_m: float = Field(
        0.1, description="Of the simulated one: how far ahead of the wheels' middle it is"
    )
    mount_height_m: float = Field(
        0.35, gt=0.0, le=2.0, description="Of the simulated one: its height above the floor"
    )

    @model_validator(mode="after")
    def _has_its_command(self) -> "CameraParameters":
        if self.source is CameraSource.COMMAND and not self.command:
            raise ValueError(
                'command: expected the program and its arguments beside source = "command", got none'
            )
        if self.command and not all(self.command):
            raise ValueError(f"command: expected no empty text in it, got {list(self.command)}")
        return self

    @model_validator(mode="after")
    def _waits_for_two_pictures(self) -> "CameraParameters":
        if self.silence_timeout_s * self.rate_hz < PICTURES_IN_SILENCE - TOLERANCE:
            least_s = PICTURES_IN_SILENCE / self.rate_hz
            raise ValueError(
                f"silence_timeout_s: expected at least {least_s:.3g} s, in which {PICTURES_IN_SILENCE} pictures come "
                f"at rate_hz = {self.rate_hz:g}, got {self.silence_timeout_s:g}: the camera would be started again "
                "for ever"
            )
        return self

    @property
    def source_name(self) -> str:
        """What it is called in sentences."""
        return self.device if self.source is CameraSource.V4L2 else self.command[0]
