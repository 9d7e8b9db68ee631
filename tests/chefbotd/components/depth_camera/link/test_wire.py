"""What a depth camera's process tells the daemon."""

import numpy as np
import pytest

from chefbotd.components.depth_camera.link.process import BEARINGS, SCAN, BadMessage, MessageReader, encode

SENT = encode(BEARINGS, 0.0, np.array([-0.5, 0.0, 0.5])) + encode(SCAN, 17.25, np.array([1.5, 0.0, 2.25]))


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_chunks_make_no_difference(size: int) -> None:
    """Byte by byte, by sevens, at once: the same two messages."""
    reader, read = MessageReader(), []
    for start in range(0, len(SENT), size):
        read += reader.feed_bytes(SENT[start : start + size])
    assert [(message.kind, message.stamp_s) for message in read] == [(BEARINGS, 0.0), (SCAN, 17.25)]
    assert read[1].values.tolist() == [1.5, 0.0, 2.25]


@pytest.mark.parametrize("data", [b"Traceback (most recent call", SENT[:12] + b"\xff\xff\xff\xff" + b"x"])
def test_what_is_no_message_is_refused(data: bytes) -> None:
    """Text, or more beams than there can be: never waited for, and never kept."""
    with pytest.raises(BadMessage, match="expected a scan"):
        list(MessageReader().feed_bytes(data))
