"""Who gets which event when, and how often it is made."""

import asyncio
import json
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from chefbotd.clock import LoopClock, ManualClock, run_virtual
from chefbotd.core.events import Direction, LineSeen, SafetyChanged, TextReceived
from chefbotd.driving.board.models import TextData
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.topics import Topic
from tests.budget import examples
from tests.fakes.robot import topics_of


def text_of(payload: EventPayload) -> str:
    """The text in an event of the topic ``text``."""
    text: str = json.loads(payload.data)["text"]
    return text


class Reader:
    """A receiver that keeps every event."""

    def __init__(self) -> None:
        self.payloads: list[EventPayload] = []
        self.policies: set[bool] = set()

    def send_event(self, payload: EventPayload, latest: bool) -> None:
        """Keep it."""
        self.payloads.append(payload)
        self.policies.add(latest)

    @property
    def texts(self) -> list[str]:
        """The texts received, in order."""
        return [text_of(payload) for payload in self.payloads]


def ignore(topic: Topic, wanted: bool) -> None:
    """Nobody makes events on demand here."""


class CountingTopic:
    """The topic ``text``, counting how often its data is made."""

    def __init__(self) -> None:
        self.conversions = 0
        self.table = {"text": replace(topics_of(simulated=False)["text"], data=self._convert)}

    def _convert(self, event: TextReceived) -> TextData:
        self.conversions += 1
        return TextData(text=event.text)


def text_fanout(clock: Any = None) -> Fanout:
    """A fan-out of every topic with events of its own; the tests use ``text`` because it is short."""
    topics = {name: topic for name, topic in topics_of(simulated=False).items() if name != "log"}
    return Fanout(topics, clock or LoopClock(), ignore)


def publish_texts(fanout: Fanout, *texts: str, stamp_s: float = 0.0) -> None:
    """Publish texts at once."""
    for text in texts:
        fanout.publish(TextReceived(stamp_s, text))


def test_an_event_that_leaves_the_state_as_it_is_is_not_sent() -> None:
    """The robot is armed, slower for an obstacle, armed: of two equal events the log of lines sends one."""
    reader, fanout = Reader(), Fanout(topics_of(simulated=False), ManualClock(100.0), ignore)
    fanout.add_receiver(reader, ["log"], "ordered", 0.0)
    for stamp_s, limited_by in ((1.0, None), (2.0, None), (3.0, "obstacle:front"), (4.0, None), (5.0, None)):
        fanout.publish(SafetyChanged(stamp_s, "armed", "started", None, limited_by=limited_by))
    assert [(payload.seq, payload.stamp_s) for payload in reader.payloads] == [(1, 1.0), (2, 3.0), (3, 4.0)]


def test_a_payload_has_the_topic_its_times_and_the_encoded_data() -> None:
    """The second event of the topic, from 99.75 s, handed out at 100 s."""
    clock, reader = ManualClock(100.0), Reader()
    fanout = text_fanout(clock)
    fanout.add_receiver(reader, ["text"], "latest", 0.0)
    fanout.publish(TextReceived(99.5, "hi"))
    fanout.publish(TextReceived(99.75, "hello"))
    assert reader.payloads[1:] == [EventPayload("text", 2, 99.75, 0.25, b'{"text":"hello"}')]


def test_an_event_is_made_once_for_everyone() -> None:
    """Three clients in two groups and a state request: one conversion, the very same bytes for all."""
    counting, readers = CountingTopic(), [Reader(), Reader(), Reader()]
    fanout = Fanout(counting.table, ManualClock(), ignore)
    fanout.add_receiver(readers[0], ["text"], "latest", 0.0)
    fanout.add_receiver(readers[1], ["text"], "latest", 0.0)
    fanout.add_receiver(readers[2], ["text"], "ordered", 0.0)
    publish_texts(fanout, "a")
    assert counting.conversions == 1
    assert readers[0].payloads[0] is readers[1].payloads[0]
    assert readers[0].payloads == readers[1].payloads == readers[2].payloads


def test_nothing_is_made_for_nobody() -> None:
    """Without subscribers events cost no conversion; the latest is there when someone asks."""
    counting, reader = CountingTopic(), Reader()
    fanout = Fanout(counting.table, ManualClock(), ignore)
    publish_texts(fanout, "a", "b", "c")
    assert counting.conversions == 0
    fanout.add_receiver(reader, ["text"], "latest", 0.0)
    fanout.snapshot(reader, ["text"])
    assert (reader.texts, counting.conversions) == (["c"], 1)


def test_an_event_may_belong_to_several_topics() -> None:
    """Each gets it, in its own form, and counts it; one whose events are made on demand shares with no other."""
    texts = topics_of(simulated=False)["text"]
    shout = replace(texts, name="shout", data=lambda event: TextData(text=event.text.upper()))
    fanout, quiet, loud = Fanout({"text": texts, "shout": shout}, ManualClock(), ignore), Reader(), Reader()
    fanout.add_receiver(quiet, ["text"], "latest", 0.0)
    fanout.add_receiver(loud, ["shout"], "latest", 0.0)
    publish_texts(fanout, "a", "b")
    assert [(p.topic, p.seq, p.data) for p in quiet.payloads] == [
        ("text", 1, b'{"text":"a"}'),
        ("text", 2, b'{"text":"b"}'),
    ]
    assert [p.data for p in loud.payloads] == [b'{"text":"A"}', b'{"text":"B"}']
    with pytest.raises(ValueError, match="TextReceived is an event of text, shout: one of an on_demand"):
        Fanout({"text": texts, "shout": replace(shout, on_demand=True)}, ManualClock(), ignore)


def test_sequence_numbers_count_events_not_deliveries() -> None:
    """A late subscriber sees how many events came before it."""
    reader, fanout = Reader(), text_fanout(ManualClock())
    publish_texts(fanout, "a", "b")
    fanout.add_receiver(reader, ["text"], "latest", 0.0)
    publish_texts(fanout, "c")
    assert reader.payloads[0].seq == 3


def test_a_snapshot_is_only_of_what_there_is() -> None:
    """A topic that has had no event yet has no snapshot."""
    reader, other, fanout = Reader(), Reader(), text_fanout(ManualClock())
    fanout.add_receiver(other, ["text"], "ordered", 0.0)
    fanout.add_receiver(reader, ["text", "battery"], "latest", 0.0)
    publish_texts(fanout, "a")
    reader.payloads.clear()
    fanout.snapshot(reader, ["text", "battery", "odometry"])
    assert (reader.texts, other.texts) == (["a"], ["a"])


def test_who_has_had_a_snapshot_gets_each_event_once() -> None:
    """Also after another snapshot, which repeats the last one, and when the other reader has left."""
    clock = ManualClock(100.0)
    fanout, reader, other = text_fanout(clock), Reader(), Reader()
    publish_texts(fanout, "a")
    for receiver in (reader, other):
        fanout.add_receiver(receiver, ["text"], "latest", 0.0)
        fanout.snapshot(receiver, ["text"])
    clock.advance(0.01)
    publish_texts(fanout, "b", "c")
    fanout.snapshot(reader, ["text"])
    clock.advance(0.01)
    publish_texts(fanout, "d")
    fanout.remove_receiver(other)
    publish_texts(fanout, "e")
    assert (reader.texts, other.texts) == (["a", "b", "c", "c", "d", "e"], ["a", "b", "c", "d"])


def timeline(max_rate_hz: float, script: Callable[[Fanout], Any]) -> list[tuple[float, str]]:
    """What a rate-limited reader gets and when, in seconds from the start."""

    async def scenario() -> list[tuple[float, str]]:
        fanout, got, clock = text_fanout(), [], LoopClock()
        start_s = clock.now_s()

        class Timed(Reader):
            def send_event(self, payload: EventPayload, latest: bool) -> None:
                text = text_of(payload)
                got.append((round(clock.now_s() - start_s, 3), text))

        fanout.add_receiver(Timed(), ["text"], "latest", 1.0 / max_rate_hz)
        await script(fanout)
        await asyncio.sleep(1.0)
        return got

    return run_virtual(scenario())


def test_a_rate_limit_thins_and_keeps_the_last_value() -> None:
    """Events every 30 ms at most every 100 ms: at 0, 100, 200 ms, then the very last at 300 ms."""

    async def script(fanout: Fanout) -> None:
        for i in range(8):  # at 0, 30, ... 210 ms
            publish_texts(fanout, str(i))
            await asyncio.sleep(0.03)

    assert timeline(10.0, script) == [(0.0, "0"), (0.1, "3"), (0.2, "6"), (0.3, "7")]


def test_a_slow_topic_is_not_delayed_by_its_rate_limit() -> None:
    """An event that comes later than the rate asks is sent at once, and only once."""

    async def script(fanout: Fanout) -> None:
        for i in range(3):
            publish_texts(fanout, str(i))
            await asyncio.sleep(0.15)

    assert timeline(10.0, script) == [(0.0, "0"), (0.15, "1"), (0.3, "2")]


@settings(max_examples=examples(40), deadline=None)
@given(st.lists(st.integers(0, 300), min_size=1, max_size=4), st.integers(1, 60), st.integers(5, 200))
def test_nobody_gets_events_sooner_than_asked_for(
    joins_ms: list[int], event_ms: int, interval_ms: int
) -> None:
    """Whenever each of a group joins: no gap is shorter than the interval, and the last value comes."""

    async def scenario() -> None:
        fanout, clock, interval_s = text_fanout(), LoopClock(), interval_ms / 1000
        got: dict[int, list[tuple[float, str]]] = {i: [] for i in range(len(joins_ms))}

        class Numbered(Reader):
            def __init__(self, number: int) -> None:
                super().__init__()
                self.got = got[number]

            def send_event(self, payload: EventPayload, latest: bool) -> None:
                self.got.append((clock.now_s(), text_of(payload)))

        async def join(number: int, after_ms: int) -> None:
            await asyncio.sleep(after_ms / 1000)
            reader = Numbered(number)
            fanout.add_receiver(reader, ["text"], "latest", interval_s)
            fanout.snapshot(reader, ["text"])

        async with asyncio.TaskGroup() as group:
            for number, after_ms in enumerate(joins_ms):
                group.create_task(join(number, after_ms))
            for i in range(20):
                publish_texts(fanout, str(i))
                await asyncio.sleep(event_ms / 1000)
        await asyncio.sleep(1.0)
        for lines in got.values():
            gaps_s = [after[0] - before[0] for before, after in pairwise(lines)]
            assert min(gaps_s, default=interval_s) > interval_s - 0.0021
            assert lines[-1][1] == "19"

    run_virtual(scenario())


def test_a_snapshot_is_an_interval_away_from_what_follows() -> None:
    """At most two a second, events every 10 ms, joined at 5 ms: snapshot, and then every half second."""

    async def scenario() -> None:
        fanout, clock = text_fanout(), LoopClock()
        got_s: list[float] = []

        class Timed(Reader):
            def send_event(self, payload: EventPayload, latest: bool) -> None:
                got_s.append(clock.now_s())

        reader = Timed()
        publish_texts(fanout, "first")
        await asyncio.sleep(0.005)
        fanout.add_receiver(reader, ["text"], "latest", 0.5)
        fanout.snapshot(reader, ["text"])
        for i in range(120):
            await asyncio.sleep(0.01)
            publish_texts(fanout, str(i))
        assert [round(after - before, 2) for before, after in pairwise(got_s)] == [0.51, 0.5]

    run_virtual(scenario())


def test_a_snapshot_is_not_repeated_as_trailing_value() -> None:
    """Who joins while a value waits for its time gets it in the snapshot, and not again."""

    async def scenario() -> None:
        early, late, fanout = Reader(), Reader(), text_fanout()
        fanout.add_receiver(early, ["text"], "latest", 0.1)
        publish_texts(fanout, "a", "b")
        fanout.add_receiver(late, ["text"], "latest", 0.1)
        fanout.snapshot(late, ["text"])
        await asyncio.sleep(0.2)
        assert (early.texts, late.texts) == (["a", "b"], ["b"])

    run_virtual(scenario())


def test_nothing_comes_after_unsubscribing() -> None:
    """A value that waited for its time is not sent to who has left, nor to an empty group."""

    async def scenario() -> None:
        reader, fanout = Reader(), text_fanout()
        fanout.add_receiver(reader, ["text"], "latest", 0.1)
        publish_texts(fanout, "a", "b")
        fanout.remove_receiver(reader)
        await asyncio.sleep(0.2)
        publish_texts(fanout, "c")
        assert reader.texts == ["a"]
        assert fanout.subscribed(reader) == []

    run_virtual(scenario())


def test_others_stay_when_one_leaves() -> None:
    """Unsubscribing one topic of one client changes nothing else."""
    stays, leaves, fanout = Reader(), Reader(), text_fanout(ManualClock())
    for reader in (stays, leaves):
        fanout.add_receiver(reader, ["text", "link"], "latest", 0.0)
    fanout.remove_receiver(leaves, ["text"])
    publish_texts(fanout, "a")
    assert (stays.texts, leaves.texts) == (["a"], [])
    assert fanout.subscribed(leaves) == ["link"]


def test_subscribing_again_replaces_rate_and_policy() -> None:
    """A client is in one group per topic: it gets each event once, by the newest terms."""
    reader, fanout = Reader(), text_fanout(ManualClock())
    fanout.add_receiver(reader, ["text", "text"], "latest", 0.0)
    fanout.add_receiver(reader, ["text"], "ordered", 0.0)
    publish_texts(fanout, "a")
    assert (reader.texts, reader.policies) == (["a"], {False})


def test_demand_is_told_when_it_begins_and_ends() -> None:
    """Of a topic made on demand the maker hears twice, however many come and go in between."""
    heard: list[tuple[str, bool]] = []
    fanout = Fanout(
        topics_of(simulated=False),
        ManualClock(),
        lambda topic, wanted: heard.append((topic.name, wanted)),
    )
    one, two = Reader(), Reader()
    fanout.add_receiver(one, ["raw", "text"], "latest", 0.0)
    fanout.add_receiver(one, ["raw"], "ordered", 0.5)
    fanout.add_receiver(two, ["raw"], "latest", 0.0)
    fanout.publish(LineSeen(0.0, Direction.FROM_BOARD, b"t\t1"))
    fanout.remove_receiver(one)
    fanout.remove_receiver(two, ["raw"])
    assert heard == [("raw", True), ("raw", False)]
    assert len(two.payloads) == 1


def test_an_unknown_topic_is_a_bug_of_the_caller() -> None:
    """Names are checked before they get here; nothing is subscribed by half."""
    reader, fanout = Reader(), text_fanout(ManualClock())
    with pytest.raises(KeyError):
        fanout.add_receiver(reader, ["text", "nonsense"], "latest", 0.0)
    assert fanout.subscribed(reader) == []


def test_data_that_does_not_fit_harms_only_its_own_topic() -> None:
    """A broken event is left out, of events, snapshots and states alike; the next good one comes through."""
    reader, fanout = Reader(), text_fanout(ManualClock())
    fanout.add_receiver(reader, ["text"], "latest", 0.0)
    broken: Any = None
    publish_texts(fanout, broken, broken)
    fanout.snapshot(reader, ["text"])
    assert (reader.payloads, fanout.states()) == ([], {})
    publish_texts(fanout, "good")
    assert reader.texts == ["good"]


def test_states_carry_their_age() -> None:
    """The latest value of each topic that has one, and how old it is now."""
    clock = ManualClock(10.0)
    fanout = text_fanout(clock)
    publish_texts(fanout, "a", stamp_s=10.0)
    clock.advance(2.5)
    states = fanout.states()
    assert list(states) == ["text"]
    assert (states["text"].seq, states["text"].age_s) == (1, 2.5)
    assert fanout.state("text") == TextReceived(10.0, "a")
