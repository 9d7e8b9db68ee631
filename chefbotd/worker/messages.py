"""The messages between daemon and worker: tagged MessagePack values, each after its length.

The process code knows these only. What a skill is asked is a struct of its own, and what it tells and answers are the
records of ``core``, all packed into ``body``: another skill needs no change here. Arrays are the bytes of little-endian
32-bit floats.
"""

from collections.abc import Iterator
from typing import Final, TypeAlias

import msgspec

from chefbotd.core.commands import RefusalKind

MOST_BYTES: Final = 1 << 25
"""No message is longer: a map of 100 by 100 m is 4 million cells, and compressed to a fraction of that."""

PREFIX_BYTES: Final = 4


class Message(msgspec.Struct, frozen=True, array_like=True):
    """The base of all: short on the wire, told apart by their tag."""


# To the worker


class Configure(Message, frozen=True, tag="configure"):
    """The first message: the parameters of each skill to load, by its name, as JSON."""

    skills: dict[str, bytes]


class ScanSeen(Message, frozen=True, tag="scan"):
    """A turn of a lidar, as in ``core.scan.LaserScan``; ``mount`` is ``base_from_lidar`` (x, y, heading)."""

    stamp_s: float
    lidar: str
    mount: tuple[float, float, float]
    bearing_rad: bytes
    range_m: bytes
    after_s: bytes


class OdometrySeen(Message, frozen=True, tag="odometry"):
    """Where odometry says the robot is, in a frame that never jumps: a reset of the odometry is taken out again."""

    stamp_s: float
    x_m: float
    y_m: float
    heading_rad: float
    linear_m_s: float
    angular_rad_s: float


class RangeSeen(Message, frozen=True, tag="range"):
    """An echo of an ultrasonic or infrared sensor; ``mount`` is ``base_from_sensor`` (x, y, heading)."""

    stamp_s: float
    sensor: str
    mount: tuple[float, float, float]
    range_m: float
    field_of_view_rad: float


class Request(Message, frozen=True, tag="request"):
    """Something for a skill to do. It must answer, or report progress, within ``deadline_s``."""

    id: int
    skill: str
    deadline_s: float
    body: bytes


class Cancel(Message, frozen=True, tag="cancel"):
    """Give up a request; it is answered all the same."""

    id: int


# From the worker


class Warming(Message, frozen=True, tag="warming"):
    """It loads a skill, and compiles it where it is not in the cache."""

    skill: str


class Ready(Message, frozen=True, tag="ready"):
    """All skills are loaded."""


class Unavailable(Message, frozen=True, tag="unavailable"):
    """It cannot work here, and starting it again would not help."""

    reason: str


class Alive(Message, frozen=True, tag="alive"):
    """Sent by a thread twice a second: what the worker is doing (empty: nothing), and for how long already."""

    doing: str
    busy_s: float


class Answer(Message, frozen=True, tag="answer"):
    """The end of a request that was carried out."""

    id: int
    body: bytes


class Progress(Message, frozen=True, tag="progress"):
    """How far a request is, in its own unit."""

    id: int
    done: float
    total: float
    text: str


class Failed(Message, frozen=True, tag="failed"):
    """The end of a request that was refused, or that was given up (``kind`` None)."""

    id: int
    kind: RefusalKind | None
    message: str


class Told(Message, frozen=True, tag="told"):
    """Something that a skill says without having been asked: a record of the class named ``kind``."""

    skill: str
    body: bytes
    kind: str = ""


ToWorker: TypeAlias = Configure | ScanSeen | OdometrySeen | RangeSeen | Request | Cancel
FromWorker: TypeAlias = Warming | Ready | Unavailable | Alive | Answer | Progress | Failed | Told

ENCODER: Final = msgspec.msgpack.Encoder()
TO_WORKER: Final = msgspec.msgpack.Decoder(ToWorker)
FROM_WORKER: Final = msgspec.msgpack.Decoder(FromWorker)


class NotAMessage(ValueError):
    """Bytes that no message is made of."""


def packed(value: msgspec.Struct | None) -> bytes:
    """A struct as MessagePack, for a ``body``; None: an answer that says no more than that it was done."""
    return ENCODER.encode(value)


def framed(message: ToWorker | FromWorker) -> bytes:
    """A message as it goes over the wire.

    Raises:
        ValueError: it is too long.
    """
    body = ENCODER.encode(message)
    if len(body) > MOST_BYTES:
        raise ValueError(f"a message has at most {MOST_BYTES} bytes, got {len(body)}")
    return len(body).to_bytes(PREFIX_BYTES, "little") + body


class FrameReader:
    """Bytes in chunks of any size -> the messages' own bytes; holds no more than one message."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The messages that are complete now.

        Raises:
            NotAMessage: a length that none has.
        """
        held = self._bytes
        held += data
        begin = 0
        while len(held) - begin >= PREFIX_BYTES:
            size = int.from_bytes(held[begin : begin + PREFIX_BYTES], "little")
            if not 0 < size <= MOST_BYTES:
                raise NotAMessage(f"a message has 1 to {MOST_BYTES} bytes, got a length of {size}")
            end = begin + PREFIX_BYTES + size
            if len(held) < end:
                break
            yield bytes(held[begin + PREFIX_BYTES : end])
            begin = end
        del held[:begin]


def decoded(decoder: "msgspec.msgpack.Decoder[FromWorker]", data: bytes) -> FromWorker:
    """The worker's message in these bytes.

    Raises:
        NotAMessage: they are none.
    """
    try:
        return decoder.decode(data)
    except msgspec.DecodeError as error:
        raise NotAMessage(f"not a message: {error}") from error
