"""What the fan-out hands to each client: an event, without the envelope that its encoding puts around it."""

from chefbotd.core.record import Record


class EventPayload(Record, frozen=True):
    """A topic's value; ``data`` is its JSON, ``age_s`` how old it is when it is handed out."""

    topic: str
    seq: int
    stamp_s: float
    age_s: float
    data: bytes
