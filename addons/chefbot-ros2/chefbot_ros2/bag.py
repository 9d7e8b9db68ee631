"""Writes a recording as a ROS 2 bag."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from rosbags.rosbag2 import StoragePlugin, Writer

from chefbot_ros2.messages import TYPESTORE, messages, mount, stamped
from chefbotd.components.recording.encoder import REPEATED
from chefbotd.components.recording.reader import OWN, RecordingReader
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.event_classes import class_of, decode

BAG_VERSION: Final = 9
"""Of ROS 2 Humble's metadata.yaml and later ones."""


class CannotWriteBagError(Exception):
    """The bag cannot be written; the message says why."""


def write_bag(recording: Path, bag: Path) -> dict[str, int]:
    """Write the recording as a new bag, a folder; how many messages each topic got.

    Raises:
        CannotWriteBagError: the bag exists already, the recording has nothing for it, or the disk refuses.
        UnreadableRecording: the recording cannot be read.
    """
    if bag.exists():
        raise CannotWriteBagError(f"{bag}: exists already, and is not overwritten")
    try:
        counts = _write(recording, bag)
        if not counts:
            text = f"{recording} has nothing that a bag holds: neither odometry nor a sensor"
            raise CannotWriteBagError(text)
    except BaseException as error:
        shutil.rmtree(bag, ignore_errors=True)
        if isinstance(error, OSError):
            raise CannotWriteBagError(f"{bag}: cannot be written: {error.strerror}") from error
        raise
    return counts


def _write(recording: Path, bag: Path) -> dict[str, int]:
    counts: dict[str, int] = {}
    connections: dict[str, Any] = {}
    with Writer(bag, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        for stamp_ns, topic, message in bag_messages(RecordingReader(recording)):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=TYPESTORE)
                counts[topic] = 0
            data = TYPESTORE.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], stamp_ns, data)
            counts[topic] += 1
    return counts


def bag_messages(reader: RecordingReader) -> Iterator[tuple[int, str, Any]]:
    """Each message with its topic and stamp, in the order of the recording."""
    mounted: set[str] = set()
    reader.read_about()
    names = wheel_names(reader)
    offset_ns = int(reader.metadata["recording"]["clock_offset_ns"])
    for recorded in reader.messages(OWN):
        event_class = class_of(recorded.schema.removeprefix(OWN))
        if recorded.sequence == REPEATED or event_class is None:
            continue
        event = decode(event_class, recorded.data)
        if isinstance(event, ScanMeasured) and event.lidar not in mounted:
            mounted.add(event.lidar)
            yield recorded.log_ns, *mount(event, stamped(event.stamp_s, offset_ns))
        for topic, message in messages(event, offset_ns, names):
            yield recorded.log_ns, topic, message


def wheel_names(reader: RecordingReader) -> tuple[str, ...]:
    """The wheels of the recorded configuration; empty where there is none."""
    try:
        configuration = json.loads(reader.metadata["configuration"]["json"])
        return tuple(str(wheel["name"]) for wheel in configuration["chassis"]["wheels"])
    except (KeyError, TypeError, ValueError):
        return ()
