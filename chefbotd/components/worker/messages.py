"""The messages between daemon and worker: tagged MessagePack values, each after its length.

The process code knows these only. What a skill is asked is a struct of its own. What is measured, and what a skill tells
and answers, are the records of ``core``. All of these are packed into ``body``: another skill needs no change here.
Arrays are the bytes of little-endian 32-bit floats.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, TypeAlias, TypeVar

import msgspec

from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured
from chefbotd.core.sentence import SAID, Sentence, mark_sentence, with_ids, with_sentences

S = TypeVar("S")

MOST_BYTES: Final = 1 << 25
"""No message is longer: a map of 100 by 100 m is 4 million cells, and compressed to a fraction of that."""

PREFIX_BYTES: Final = 4


class Message(msgspec.Struct, frozen=True, array_like=True):
    """The base of all: short on the wire, told apart by their tag."""


# To the worker


class Configure(Message, frozen=True, tag="configure"):
    """The first message: the parameters of each skill to load, by its name, as JSON.

    ``references`` has the module and the class of each skill of a stranger, which is left out where it fails.
    """

    skills: dict[str, bytes]
    references: dict[str, str] = {}


class Measured(Message, frozen=True, tag="measured"):
    """An event of the class named ``kind``.

    Odometry is sent in a frame that never jumps (``steady``): a reset of the odometry is taken out of it.
    """

    kind: str
    body: bytes


class SkillRequest(Message, frozen=True, tag="request"):
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


class SkillLeftOut(Message, frozen=True, tag="left out"):
    """A skill of a stranger has failed, and why; the others go on without it."""

    skill: str
    reason: str


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


class RequestProgress(Message, frozen=True, tag="progress"):
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
    said: dict[str, Any] = {}  # the sentence's id and arguments


class SkillEvent(Message, frozen=True, tag="told"):
    """Something that a skill says without having been asked: a record of the class named ``kind``."""

    skill: str
    body: bytes
    kind: str = ""


ToWorker: TypeAlias = Configure | Measured | SkillRequest | Cancel
FromWorker: TypeAlias = (
    Warming | SkillLeftOut | Ready | Unavailable | Alive | Answer | RequestProgress | Failed | SkillEvent
)

Measurement: TypeAlias = ScanMeasured | OdometryUpdated | RangeMeasured

ARRAY: Final = 1
"""The code of an array among MessagePack's extension types."""


def _array_to_extension(value: Any) -> msgspec.msgpack.Ext | str:
    if isinstance(value, Sentence):
        return str(value)
    return msgspec.msgpack.Ext(ARRAY, value.astype("<f4").tobytes())


class _SentenceMet(Exception):
    """There is a sentence in what is packed."""


def _refuse_sentence(value: Any) -> msgspec.msgpack.Ext | str:
    if isinstance(value, Sentence):
        raise _SentenceMet
    return _array_to_extension(value)


def _mark_sentence(value: Any) -> Any:
    return mark_sentence(value) if isinstance(value, Sentence) else _array_to_extension(value)


def _extension_to_array(code: int, data: memoryview) -> Any:
    import numpy as np  # the daemon's side decodes no array

    return np.frombuffer(data, "<f4").astype(np.float64)


ENCODER: Final = msgspec.msgpack.Encoder(enc_hook=_array_to_extension)
BODIES: Final = msgspec.msgpack.Encoder(enc_hook=_refuse_sentence)
MARKED: Final = msgspec.msgpack.Encoder(enc_hook=_mark_sentence)
HAS_SENTENCES: Final = msgspec.msgpack.encode(SAID)
"""The bytes without which there is no sentence in a body."""
MEASUREMENTS: Final[Mapping[str, "msgspec.msgpack.Decoder[Measurement]"]] = {
    kind.__name__: msgspec.msgpack.Decoder(kind, ext_hook=_extension_to_array)
    for kind in (ScanMeasured, OdometryUpdated, RangeMeasured)
}
TO_WORKER: Final = msgspec.msgpack.Decoder(ToWorker)
FROM_WORKER: Final = msgspec.msgpack.Decoder(FromWorker)


class NotAMessage(ValueError):
    """Bytes that no message is made of."""


def pack_body(value: msgspec.Struct | None) -> bytes:
    """A struct as MessagePack, for a ``body``; None: an answer that says no more than that it was done."""
    try:
        return BODIES.encode(value)
    except _SentenceMet:
        return ENCODER.encode(with_ids(msgspec.msgpack.decode(MARKED.encode(value))))


def unpack_body(decoder: "msgspec.msgpack.Decoder[S]", body: bytes) -> S:
    """The struct that ``pack_body`` has packed, each sentence in it with its id; raises ``ValueError`` for another."""
    value = decoder.decode(body)
    if HAS_SENTENCES not in body:
        return value
    return msgspec.convert(with_sentences(msgspec.msgpack.decode(body)), decoder.type, builtin_types=(bytes,))


def make_measured(event: Measurement) -> Measured:
    """The message with this event."""
    return Measured(type(event).__name__, ENCODER.encode(event))


def event_in(message: Measured) -> Measurement:
    """The event that was measured."""
    return MEASUREMENTS[message.kind].decode(message.body)


def frame_message(message: ToWorker | FromWorker) -> bytes:
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


def decode_message(decoder: "msgspec.msgpack.Decoder[FromWorker]", data: bytes) -> FromWorker:
    """The worker's message in these bytes.

    Raises:
        NotAMessage: they are none.
    """
    try:
        return decoder.decode(data)
    except ValueError as error:
        raise NotAMessage(f"not a message: {error}") from error
