"""Messages on the wire: the same whatever the chunks, and nothing else is taken for one."""

import contextlib

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.worker.messages import (
    FROM_WORKER,
    MOST_BYTES,
    TO_WORKER,
    Alive,
    Answer,
    Cancel,
    Configure,
    Failed,
    FrameReader,
    Measured,
    NotAMessage,
    Ready,
    RequestProgress,
    SkillEvent,
    SkillRequest,
    Unavailable,
    Warming,
    decode_message,
    event_in,
    frame_message,
    make_measured,
    pack_body,
    unpack_body,
)
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured, RangeStatus
from chefbotd.core.geometry import CERTAIN, Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.core.scan import LaserScan
from chefbotd.core.sentence import Sentence, sentence_data

TO = [
    Configure({"mapping": b"{}"}),
    Measured("ScanMeasured", b"\x80"),
    SkillRequest(7, "mapping", 30.0, b"\x90"),
    Cancel(7),
]
FROM = [
    Warming("mapping"),
    Ready(),
    Unavailable("no numba"),
    Alive("mapping: a scan", 0.01),
    Answer(7, b"\x90"),
    RequestProgress(7, 3.0, 10.0, "matching"),
    Failed(7, RefusalKind.NOT_MAPPING, "no map is being made"),
    Failed(8, None, "it was cancelled"),
    SkillEvent("mapping", b"\x91\x01"),
]


def test_every_message_comes_out_as_it_went_in() -> None:
    """Each message of both directions survives its way over the wire."""
    reader = FrameReader()
    sent = b"".join(map(frame_message, TO))
    assert [TO_WORKER.decode(frame) for frame in reader.feed(sent)] == TO
    sent = b"".join(map(frame_message, FROM))
    assert [decode_message(FROM_WORKER, frame) for frame in reader.feed(sent)] == FROM


@pytest.mark.parametrize(
    "event",
    [
        OdometryUpdated(12.51, 12.52, Pose2D(1.0, -2.0, 0.3), Twist2D(0.2, -0.1), CERTAIN),
        RangeMeasured(12.5, 12.6, "front", RangeStatus.OK, 0.65, 0.02, 4.0, 0.26),
    ],
)
def test_what_is_measured_comes_out_as_it_went_in(event: OdometryUpdated | RangeMeasured) -> None:
    """The event itself, with every field."""
    assert event_in(make_measured(event)) == event


def test_a_turn_comes_out_in_single_precision() -> None:
    """0.1 becomes the nearest number of 32 bits, 1.5 has one; a reading that is none stays none."""
    scan = LaserScan(12.5, np.array([0.1, 1.5]), np.array([0.0, np.inf]), np.array([-0.1, 0.0]))
    event = event_in(make_measured(ScanMeasured(12.5, "top", Pose2D(0.1, -0.02, 3.1), scan)))
    assert isinstance(event, ScanMeasured)
    assert (event.stamp_s, event.lidar, event.base_from_lidar) == (12.5, "top", Pose2D(0.1, -0.02, 3.1))
    assert event.scan.bearing_rad.tolist() == [float(np.float32(0.1)), 1.5]
    assert event.scan.range_m.tolist() == [0.0, np.inf]
    assert event.scan.after_s.tolist() == [float(np.float32(-0.1)), 0.0]


@given(st.lists(st.integers(1, 60), max_size=40))
def test_chunks_do_not_matter(sizes: list[int]) -> None:
    """Whatever pieces the bytes come in, the same messages come out, in the same order."""
    sent, reader, found, begin = b"".join(map(frame_message, FROM)), FrameReader(), [], 0
    for size in [*sizes, len(sent)]:
        found += [decode_message(FROM_WORKER, frame) for frame in reader.feed(sent[begin : begin + size])]
        begin += size
    assert found == FROM


@pytest.mark.parametrize("length", [0, MOST_BYTES + 1, 0xFFFFFFFF])
def test_a_length_that_no_message_has_is_refused_at_once(length: int) -> None:
    """A reader does not wait for 4 GB that garbage promises, and the message says the length."""
    with pytest.raises(NotAMessage, match=str(length)):
        list(FrameReader().feed(length.to_bytes(4, "little")))


@pytest.mark.parametrize(
    "body",
    [
        b"\x91\xa6read\x80y",
        b"\xc1",
        b"\x91\xa5ready\x00",
        b"\x92\xa5alive\x01",
        b"\x91\xa4nope",
        b"\x81\x01\x02",
        b"\xff" * 9,
    ],
)
def test_what_is_no_message_of_the_worker_is_refused(body: bytes) -> None:
    """Bytes that are not MessagePack, or not one of the worker's messages, are told apart."""
    with pytest.raises(NotAMessage):
        decode_message(FROM_WORKER, body)


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_else(body: bytes) -> None:
    """Any bytes are a message or are refused as none."""
    with contextlib.suppress(NotAMessage):
        decode_message(FROM_WORKER, body)


def test_a_message_that_is_too_long_is_not_sent() -> None:
    """The sender hears of it, with both sizes, instead of the receiver."""
    with pytest.raises(ValueError, match=str(MOST_BYTES)):
        frame_message(SkillEvent("mapping", bytes(MOST_BYTES)))


class Said(Record, frozen=True):
    """What a skill tells."""

    reason: str
    parts: tuple["Said", ...] = ()
    image: bytes = b""


def test_a_sentence_crosses_the_pipe_with_its_id() -> None:
    """Also one within a part of what is told; what has none is packed as it always was."""
    decoder = msgspec.msgpack.Decoder(Said)
    far = Sentence("trip.far", "{place} is far away", place="bar")
    told = Said("off", (Said(far, (), b"\xff"), Said("on")), b"\x00")
    arrived = unpack_body(decoder, pack_body(told))
    assert arrived == told
    assert sentence_data(arrived.parts[0].reason) == {"id": "trip.far", "arguments": {"place": "bar"}}
    assert pack_body(Said("off")) == msgspec.msgpack.encode(Said("off"))
    assert decoder.decode(pack_body(told)) == told
