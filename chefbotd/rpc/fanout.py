"""Takes events of the bus and hands each one, as the same payload, to every client that subscribed to its topic.

Clients that want the same topic at the same rate under the same policy form a group. Whether an event is due is
decided once per group, and its JSON is made once for all. A value that comes too soon is not lost: the latest value
follows when it is due. A client that has just had a snapshot gets nothing for one interval, and then the same events
as its group. For a topic without subscribers only the latest state is kept.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import structlog
from msgspec import Raw, Struct

from chefbotd.bus import Bus, OnError
from chefbotd.clock import Clock
from chefbotd.rpc.encoding import EventPayload, encode
from chefbotd.rpc.method import EventSink, Receiver
from chefbotd.rpc.models import TopicState
from chefbotd.rpc.topics import Topic

log = structlog.get_logger(__name__)


class Feed:
    """A topic's latest state, and its JSON once someone has asked for it."""

    def __init__(self, topic: Topic, clock: Clock) -> None:
        self.topic, self._join, self._clock = topic, topic.join, clock
        self.state: Any = None
        self.seq = 0
        self.stamp_s = 0.0
        self.groups: dict[tuple[str, float], Group] = {}
        self._json: bytes | None = None
        self._faulty = False

    def take_event(self, event: Any) -> None:
        """Remember an event, which is not converted, and send it to every client for which it is due."""
        if self._join is None:
            self.state = event
        else:
            before, self.state = self.state, self._join(self.state, event)
            if self.state is before:
                return
        self.seq += 1
        self.stamp_s = event.stamp_s
        self._json = None
        if self.groups:
            now_s = self._clock.now_s()
            for group in self.groups.values():
                group.offer(now_s)

    def payload(self, now_s: float) -> EventPayload | None:
        """The state, encoded once, as an event's payload; None when there is none or (logged once) it cannot be sent."""
        json, topic = self._json, self.topic
        if json is None:
            if self.state is None:
                return None
            try:
                json = self._json = encode(topic.data(self.state))
            except Exception:
                if not self._faulty:
                    log.exception("telemetry_fault", topic=topic.name, state=self.state)
                self._faulty = True
                return None
            self._faulty = False
        age_s = now_s - self.stamp_s
        return EventPayload(topic.name, self.seq, self.stamp_s, age_s if age_s > 0 else 0.0, json)


TIMER_RESOLUTION_S = 0.002
"""How much too early a timer of uvloop's, which counts whole milliseconds, may be."""


class Member(Struct):
    """The last event that a member has had, and when its snapshot is old enough for the next."""

    seen: int = 0
    due_s: float = float("-inf")


class Group:
    """The receivers of a topic at one rate and with one policy.

    A member is new until the first event behind its snapshot is sent. From then on it gets what the others get, by one
    call.
    """

    def __init__(self, feed: Feed, policy: str, interval_s: float, clock: Clock) -> None:
        self._feed, self._clock = feed, clock
        self._latest, self._interval_s = policy == "latest", interval_s
        self._new: dict[Receiver, Member] = {}
        self._steady: dict[Receiver, EventSink] = {}
        self._sent = 0  # the event that the steady members have had
        self._due_s = float("-inf")
        self._timer: asyncio.TimerHandle | None = None

    def __contains__(self, receiver: Receiver) -> bool:
        return receiver in self._steady or receiver in self._new

    def __bool__(self) -> bool:
        return bool(self._steady or self._new)

    def add(self, receiver: Receiver) -> None:
        """A new member, which has seen nothing yet."""
        self._new[receiver] = Member()

    def remove(self, receiver: Receiver) -> None:
        """A member leaves; without members nothing stays scheduled."""
        self._steady.pop(receiver, None)
        self._new.pop(receiver, None)
        if not self:
            self._cancel_timer()

    def snapshot(self, receiver: Receiver) -> None:
        """The latest value, for one member."""
        now_s = self._clock.now_s()
        payload = None if self._feed.topic.passing else self._feed.payload(now_s)
        if payload is not None:
            self._steady.pop(receiver, None)
            self._new[receiver] = Member(self._feed.seq, now_s + self._interval_s - TIMER_RESOLUTION_S)
            receiver.send_event(payload, self._latest)

    def offer(self, now_s: float) -> None:
        """Send a new value, now or when it is due."""
        if self._interval_s == 0.0 or now_s >= self._due_s:
            self._send_payload(now_s)
        elif self._timer is None:
            self._send_when_due(now_s)

    def _send_when_due(self, now_s: float) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(self._due_s - now_s, lambda: self._send_payload(self._clock.now_s()))

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _send_payload(self, now_s: float) -> None:
        if self._timer is not None:
            self._cancel_timer()
        self._due_s = now_s + self._interval_s
        payload = self._feed.payload(now_s)
        if payload is None:
            return
        seq, latest = self._feed.seq, self._latest
        if seq != self._sent:
            self._sent = seq
            for send_event in self._steady.values():
                send_event(payload, latest)
        if self._new:
            self._send_to_new(payload, now_s)

    def _send_to_new(self, payload: EventPayload, now_s: float) -> None:
        """Send an event to those who are new, but for those for whom it is too early."""
        early = False
        for receiver, member in list(self._new.items()):
            if member.seen == payload.seq:  # a snapshot has brought it already
                continue
            if now_s < member.due_s:
                early = True
                continue
            del self._new[receiver]
            self._steady[receiver] = send_event = receiver.send_event
            send_event(payload, self._latest)
        if early:
            self._send_when_due(now_s)


class Fanout:
    """The topics, their groups, and who is in which.

    ``on_demand`` is called when a topic whose events are costly gets its first subscriber, and when it loses its last.

    Raises:
        ValueError: an event of an ``on_demand`` topic is one of another topic, too.
    """

    def __init__(
        self, topics: Mapping[str, Topic], clock: Clock, on_demand: Callable[[Topic, bool], None]
    ) -> None:
        self._clock, self._on_demand = clock, on_demand
        self._feeds = {name: Feed(topic, clock) for name, topic in topics.items()}
        self._by_event: dict[type[object], tuple[Feed, ...]] = {}
        for feed in self._feeds.values():
            for event in feed.topic.events:
                self._by_event[event] = (*self._by_event.get(event, ()), feed)
        for event, feeds in self._by_event.items():
            if len(feeds) > 1 and any(feed.topic.on_demand for feed in feeds):
                names = ", ".join(feed.topic.name for feed in feeds)
                raise ValueError(
                    f"{event.__name__} is an event of {names}: one of an on_demand topic is of no other"
                )

    @property
    def topics(self) -> dict[str, Topic]:
        """The table behind it."""
        return {name: feed.topic for name, feed in self._feeds.items()}

    def publish(self, event: object) -> None:
        """Send an event to every client for which it is due."""
        for feed in self._by_event[type(event)]:
            feed.take_event(event)

    def listen_to(self, topic: Topic, bus: Bus, on_error: OnError) -> Callable[[], None]:
        """Send this topic's events of the bus as ``publish`` does; returns what ends that."""
        return bus.add_handler(self._feeds[topic.name].take_event, *topic.events, on_error=on_error)

    def add_receiver(self, receiver: Receiver, names: Iterable[str], policy: str, interval_s: float) -> None:
        """Put a receiver into these topics' groups, out of any other; an unknown topic raises ``KeyError``."""
        for feed in [self._feeds[name] for name in names]:
            had_subscribers = bool(feed.groups)
            self._leave(receiver, feed)
            key = ("ordered", 0.0) if feed.topic.passing else (policy, interval_s)
            group = feed.groups.setdefault(key, Group(feed, *key, self._clock))
            group.add(receiver)
            self._tell_demand(feed, had_subscribers)

    def snapshot(self, receiver: Receiver, names: Iterable[str]) -> None:
        """The latest value of each of these topics that the receiver is subscribed to."""
        for name in names:
            for group in self._feeds[name].groups.values():
                if receiver in group:
                    group.snapshot(receiver)

    def remove_receiver(self, receiver: Receiver, names: Iterable[str] | None = None) -> None:
        """Take a receiver out of these topics, or of all; raises ``KeyError`` for an unknown topic."""
        for feed in [self._feeds[name] for name in (self._feeds if names is None else names)]:
            had_subscribers = bool(feed.groups)
            self._leave(receiver, feed)
            self._tell_demand(feed, had_subscribers)

    def _leave(self, receiver: Receiver, feed: Feed) -> None:
        for key, group in list(feed.groups.items()):
            if receiver in group:
                group.remove(receiver)
                if not group:
                    del feed.groups[key]

    def _tell_demand(self, feed: Feed, wanted_before: bool) -> None:
        has_subscribers = bool(feed.groups)
        if feed.topic.on_demand and has_subscribers != wanted_before:
            self._on_demand(feed.topic, has_subscribers)

    def subscribed(self, receiver: Receiver) -> list[str]:
        """The topics that a receiver takes, in the table's order."""
        return [n for n, feed in self._feeds.items() if any(receiver in g for g in feed.groups.values())]

    def is_subscribed(self, receiver: Receiver) -> bool:
        """Whether a receiver takes any topic."""
        return any(receiver in group for feed in self._feeds.values() for group in feed.groups.values())

    def state(self, topic: str) -> Any:
        """A topic's latest state, unconverted; None before its first event."""
        return self._feeds[topic].state

    def states(self) -> dict[str, TopicState]:
        """The latest value of each topic that has one."""
        now_s = self._clock.now_s()
        feeds = ((name, feed) for name, feed in self._feeds.items() if not feed.topic.passing)
        payloads = ((name, feed.payload(now_s)) for name, feed in feeds)
        return {
            name: TopicState(seq=p.seq, stamp_s=p.stamp_s, age_s=p.age_s, data=Raw(p.data))
            for name, p in payloads
            if p is not None
        }
