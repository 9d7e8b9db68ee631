"""What is asked and answered about the camera."""

from typing import Annotated

from msgspec import Meta
from pydantic import Field

from chefbotd.core.record import Record
from chefbotd.rpc.models import Params


class GetCameraFrameParams(Params):
    """Which picture: the first one that is newer than ``after``."""

    after: int = Field(
        0, ge=0, description="the number of the last picture that was seen; 0: any", examples=[41]
    )
    wait_s: float = Field(5.0, ge=0.0, le=10.0, description="how long to wait for a newer one")


class CameraFrame(Record, frozen=True):
    """A picture of the camera. Numbers begin anew with the daemon."""

    number: int
    stamp_s: Annotated[float, Meta(description="when it was taken")]
    age_s: Annotated[float, Meta(description="how old it is when it is handed out")]
    width_px: int
    height_px: int
    jpeg: Annotated[str, Meta(description="the picture: JPEG in base64")]


class CameraFigures(Record, frozen=True):
    """How the camera is, and what it did since the daemon's start."""

    state: str
    reason: str
    source: str
    width_px: int
    height_px: int
    age_s: Annotated[float | None, Meta(description="of the last picture; null: there is none")]
    pictures: int
    dropped: Annotated[int, Meta(description="what was cut, damaged or too long")]
    starts: int
    viewers: int
