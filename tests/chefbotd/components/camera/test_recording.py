"""Pictures in a recording: as viewers know them, and without any part in a replay."""

import base64
import json
from typing import Any

import pytest

from chefbotd.components.camera.events import CameraPictureTaken
from chefbotd.components.recording.chunk import Channels, ChunkBuilder
from chefbotd.components.recording.encoder import Encoder
from chefbotd.event_classes import class_of, decode
from tests.chefbotd.components.camera.pictures import picture


class Messages:
    """What the encoder writes, by channel."""

    def __init__(self) -> None:
        self.added: list[tuple[int, dict[str, Any]]] = []

    def add(self, channel: int, sequence: int, log_ns: int, payload: bytes) -> None:
        """Keep it as JSON."""
        self.added.append((channel, json.loads(payload)))


def test_a_recorded_picture_is_a_compressed_image_and_an_event_without_it() -> None:
    """So it stands in the file once; the event can be read, and written again to the byte."""
    messages, channels = Messages(), Channels()
    event = CameraPictureTaken(12.5, 32, 24, len(picture()), picture())
    Encoder(messages, channels, 1_000_000_000, None).encode_event(event)
    (_, written), (_, image) = messages.added
    assert written == {"stamp_s": 12.5, "width_px": 32, "height_px": 24, "size_bytes": len(picture()), "jpeg": ""}
    assert base64.b64decode(image["data"]) == picture()
    assert (image["format"], image["timestamp"]) == ("jpeg", {"sec": 13, "nsec": 500_000_000})
    again = decode(CameraPictureTaken, json.dumps(written).encode())
    assert again.encode_recorded() == event.encode_recorded()
    assert class_of("CameraPictureTaken") is CameraPictureTaken
