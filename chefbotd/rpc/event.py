"""An event as the fan-out passes it to each client, without the envelope of the encoding."""

from chefbotd.core.record import Record


class EventPayload(Record, frozen=True):
    """A topic's value; ``data`` is its JSON, ``age_s`` how old it is when it is handed out."""

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: bytes
