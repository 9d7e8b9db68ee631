"""The robot's state and events, parsed from the daemon's messages."""

from collections.abc import Mapping
from typing import Any, TypeVar

from chefbotd.client.caller import parse
from chefbotd.client.errors import NotReported
from chefbotd.client.event import Event
from chefbotd.client.models import (
    DATA_BY_TOPIC,
    BatteryData,
    ImuData,
    LidarsData,
    LinkData,
    OdometryData,
    RangesData,
    SafetyData,
    SimData,
    UnknownData,
    WheelsData,
)
from chefbotd.core.record import Record
from chefbotd.rpc.encoding import Sent

D = TypeVar("D", bound=Sent)


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
    return _opened(envelope.topic, envelope)


def _opened(topic: str, envelope: _Envelope) -> Event[Any]:
    data = parse(DATA_BY_TOPIC.get(topic, UnknownData), envelope.data)
    return Event(topic, envelope.seq, envelope.stamp_s, envelope.age_s, data)


class State(Record, frozen=True):
    """The robot at one moment: its link, its safety, and the latest event of every topic that has had one.

    ``odometry``, ``wheels`` and so on are the data of that topic; they raise ``NotReported`` where there is none yet.
    """

    stamp_s: float
    link: LinkData
    safety: SafetyData
    topics: Mapping[str, Event[Any]]

    @property
    def odometry(self) -> OdometryData:
        """Pose in ``odom`` (m, rad CCW positive) and twist (m/s, rad/s)."""
        return self._latest("odometry", OdometryData)

    @property
    def wheels(self) -> WheelsData:
        """Positions (rad), speeds (rad/s) and duties by wheel, in the order of ``name``."""
        return self._latest("wheels", WheelsData)

    @property
    def imu(self) -> ImuData:
        """Orientation, turning rates (rad/s) and accelerations (m/s2)."""
        return self._latest("imu", ImuData)

    @property
    def ranges(self) -> RangesData:
        """The latest beam of each range sensor (m)."""
        return self._latest("ranges", RangesData)

    @property
    def battery(self) -> BatteryData:
        """Volts and percent."""
        return self._latest("battery", BatteryData)

    @property
    def lidars(self) -> LidarsData:
        """The health of each lidar."""
        return self._latest("lidars", LidarsData)

    @property
    def sim(self) -> SimData:
        """Where a simulated robot really is (m, rad)."""
        return self._latest("sim", SimData)

    def _latest(self, topic: str, model: type[D]) -> D:
        event = self.topics.get(topic)
        if event is None or not isinstance(event.data, model):
            link = "" if self.link.state == "up" else f"; the link is down: {self.link.reason}"
            raise NotReported(f"the robot has not reported {topic} yet{link}")
        return event.data


def parse_state(result: object) -> State:
    """The result of ``get_state``; raises ``ProtocolError``."""
    state = parse(_WireState, result)
    topics = {topic: _opened(topic, envelope) for topic, envelope in state.topics.items()}
    return State(state.stamp_s, state.link, state.safety, topics)
