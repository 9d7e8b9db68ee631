"""The robot's state and events, parsed from the daemon's messages."""

from collections.abc import Mapping
from typing import Any

from chefbotd.client.caller import parse
from chefbotd.client.event import Event
from chefbotd.client.models import DATA_BY_TOPIC, LinkData, SafetyData, TopicsOfState, UnknownData
from chefbotd.core.record import Record


class _Envelope(Record, frozen=True):
    seq: int
    stamp_s: float
    age_s: float
    data: dict[str, Any]


class _NamedEnvelope(_Envelope, frozen=True):
    topic: str


class _WireState(Record, frozen=True):
    stamp_s: float
    link: LinkData
    safety: SafetyData
    topics: dict[str, _Envelope]


def parse_event(params: object) -> Event[Any]:
    """The parameters of an ``event`` notification; raises ``ProtocolError``."""
    envelope = parse(_NamedEnvelope, params)
    return _open_envelope(envelope.topic, envelope)


def _open_envelope(topic: str, envelope: _Envelope) -> Event[Any]:
    data = parse(DATA_BY_TOPIC.get(topic, UnknownData), envelope.data)
    return Event(topic, envelope.seq, envelope.stamp_s, envelope.age_s, data)


class State(TopicsOfState, Record, frozen=True):
    """The robot at one moment: its link, its safety, and the latest event of every topic that has had one.

    ``odometry``, ``wheels`` and so on are the data of that topic; they raise ``NotReported`` where there is none yet.
    """

    stamp_s: float
    link: LinkData
    safety: SafetyData
    topics: Mapping[str, Event[Any]]


def parse_state(result: object) -> State:
    """The result of ``get_state``; raises ``ProtocolError``."""
    state = parse(_WireState, result)
    topics = {topic: _open_envelope(topic, envelope) for topic, envelope in state.topics.items()}
    return State(state.stamp_s, state.link, state.safety, topics)
