"""Pictures in a recording: as viewers know them, and without any part in a replay."""

import asyncio
import base64
import json
from pathlib import Path
from typing import Any

from chefbotd.components.camera.events import CameraPictureTaken
from chefbotd.components.recording.chunk import Channels
from chefbotd.components.recording.encoder import Encoder
from chefbotd.components.recording.reader import RecordingReader
from chefbotd.event_classes import class_of, decode
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.camera.pictures import picture
from tests.chefbotd.components.recording.replay.recordings import recorded_file, replayed
from tests.chefbotd.components.recording.replay.test_replay import drive


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
    assert written == {
        "stamp_s": 12.5,
        "width_px": 32,
        "height_px": 24,
        "size_bytes": len(picture()),
        "jpeg": "",
    }
    assert base64.b64decode(image["data"]) == picture()
    assert (image["format"], image["timestamp"]) == ("jpeg", {"sec": 13, "nsec": 500_000_000})
    again = decode(CameraPictureTaken, json.dumps(written).encode())
    assert again.encode_recorded() == event.encode_recorded()
    assert class_of("CameraPictureTaken") is CameraPictureTaken


async def driven_by_sight(robot: SimulatedRobot) -> None:
    """Somebody drives while looking, and a picture is recorded twice a second."""
    await robot.client.arm()
    number = 0
    for _ in range(6):
        await drive(robot, 0.2, 0.4, 0.3)
        number = (await robot.client.get_camera_frame(after=number)).number
    await asyncio.sleep(1.0)


def test_a_drive_with_recorded_pictures_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    """From the file, in which the pictures are; what is computed again needs none of them."""
    settings = load(overrides={"camera": {"enabled": True, "recorded_hz": 2.0}})
    path = recorded_file(driven_by_sight, settings, tmp_path)
    reader = RecordingReader(path)
    schemas = [message.schema for message in reader.messages()]
    assert schemas.count("foxglove.CompressedImage") == schemas.count("chefbotd.CameraPictureTaken") >= 4
    outcome = replayed(list(RecordingReader(path).events()), settings)
    assert outcome.exact, outcome.comparison.first
    assert outcome.comparison.counts["CameraPictureTaken"] >= 4
    assert outcome.comparison.counts["WheelsDriven"] > 50
