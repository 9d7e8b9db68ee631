"""Pictures in a stream of Motion JPEG."""

from typing import Any

import pytest

from chefbotd.components.camera.algorithms.mjpeg_stream import MjpegStream
from tests.chefbotd.components.camera.pictures import picture

PICTURES = [picture(grey) for grey in (10, 120, 240)]


def read(stream: MjpegStream, data: bytes, chunk: int) -> list[bytes]:
    """Everything that is found, in chunks of this size."""
    return [
        found
        for start in range(0, len(data), chunk)
        for found in stream.find_pictures(data[start : start + chunk])
    ]


@pytest.mark.parametrize("chunk", [1, 7, 512, 1 << 20])
def test_however_the_stream_is_chunked_its_pictures_are_the_same(chunk: int) -> None:
    """Byte by byte, or at once."""
    stream = MjpegStream(100_000)
    assert read(stream, b"".join(PICTURES), chunk) == PICTURES
    assert stream.dropped == 0


@pytest.mark.parametrize("chunk", [1, 1000])
def test_the_heads_of_a_multipart_stream_are_passed_over(chunk: int) -> None:
    """As ``ffmpeg -f mpjpeg`` writes it."""
    heads = [
        f"\r\n--ffmpeg\r\nContent-type: image/jpeg\r\nContent-length: {len(each)}\r\n\r\n".encode() + each
        for each in PICTURES
    ]
    assert read(MjpegStream(100_000), b"".join(heads), chunk) == PICTURES


@pytest.mark.parametrize("chunk", [1, 1000])
def test_a_picture_that_the_next_one_cuts_off_is_dropped_and_counted(chunk: int) -> None:
    """In its data or in its head: the others stay whole."""
    first, _, third = PICTURES
    large = picture(120, 400, 300)
    for end in (len(large) - 2, len(large) - 40, 400, 200, 30, 3):
        stream = MjpegStream(100_000)
        assert read(stream, first + large[:end] + third, chunk) == [first, third]
        assert stream.dropped == 1


def test_a_thumbnail_in_the_head_is_not_mistaken_for_a_picture() -> None:
    """A segment says how long it is: what is in it is none of the stream's."""
    thumbnail = picture(50, 16, 16)
    segment = b"\xff\xe1" + (2 + len(thumbnail)).to_bytes(2, "big") + thumbnail
    with_it = PICTURES[0][:2] + segment + PICTURES[0][2:]
    assert read(MjpegStream(100_000), with_it + PICTURES[1], 64) == [with_it, PICTURES[1]]


def test_a_picture_that_is_too_long_is_dropped_and_the_next_one_is_found() -> None:
    """At most so many bytes are held."""
    stream = MjpegStream(len(PICTURES[0]) + 100)
    longer = picture(77, 600, 400)
    assert read(stream, longer + PICTURES[0], 50) == [PICTURES[0]]
    assert stream.dropped == 1


def test_a_stream_of_something_else_holds_no_memory() -> None:
    """Raw video without end."""
    stream = MjpegStream(10_000)
    assert read(stream, bytes(range(256)) * 4000, 4096) == []
    assert len(stream._data) <= 10_000


class CountedBytes(bytearray):
    """Counts the bytes that are looked at."""

    looked_at = 0

    def find(self, sub: Any, start: Any = 0, end: Any = None) -> int:
        """As of bytes."""
        end = len(self) if end is None else end
        found = super().find(sub, start, end)
        self.looked_at += (found if found >= 0 else end) - start
        return found

    def __getitem__(self, place: Any) -> Any:
        """As of bytes."""
        self.looked_at += 1
        return super().__getitem__(place)


@pytest.mark.parametrize("unit", [b"\xff", b"\xff\xd8", b"\xff\xe0\x00\x02", b"\xff\xd8\xff\xda\x00\x02"])
@pytest.mark.parametrize("chunk", [64, 1 << 20])
def test_garbage_costs_no_more_than_its_length(unit: bytes, chunk: int) -> None:
    """Heads without end and pictures without end: each byte is looked at a few times, not once for each other one."""
    stream = MjpegStream(10_000)
    stream._data = counted = CountedBytes()
    garbage = b"\xff\xd8" + unit * (30_000 // len(unit))
    assert read(stream, garbage, chunk) == []
    assert counted.looked_at < 10 * len(garbage)
