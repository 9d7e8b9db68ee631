"""What is said of the camera, and the pictures that are recorded."""

from typing import ClassVar, Literal

import msgspec

from chefbotd.core.record import Level, LogLine, Record, replace
from chefbotd.core.sentence import Sentence, plain_words

_ENCODER = msgspec.json.Encoder(enc_hook=plain_words)


class CameraData(Record, frozen=True):
    """The camera: it is ``off`` while nobody looks, ``starting``, ``running``, or has ``failed`` for a ``reason``.

    ``width_px`` and ``height_px`` are those of its last picture; 0: there was none.
    """

    state: Literal["off", "starting", "running", "failed"] = "off"
    reason: str = ""
    width_px: int = 0
    height_px: int = 0


class CameraChanged(CameraData, frozen=True, kw_only=True):
    """The camera was switched on or off, sends pictures, or has failed."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log: the same one, which is written once, however often somebody looks and looks away."""
        if self.state == "failed":
            return LogLine(
                Level.WARNING, "camera", Sentence("camera.no_picture", "no picture: {why}", why=self.reason)
            )
        return LogLine(Level.INFO, "camera", Sentence("camera.well", "nothing is known to be wrong"))


class CameraPictureTaken(Record, frozen=True):
    """A picture that is recorded: on the topic ``/camera`` of a recording, as viewers know it.

    The event itself is recorded without the picture, so ``jpeg`` is empty in one that was read.
    """

    drawn_as: ClassVar[str] = "picture"

    stamp_s: float
    width_px: int
    height_px: int
    size_bytes: int
    jpeg: bytes = b""

    def encode_recorded(self) -> bytes:
        """The event as it is recorded."""
        return _ENCODER.encode(replace(self, jpeg=b""))
