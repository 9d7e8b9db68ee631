"""Recorded and replayed events held against each other, and gaps in a recording."""

import asyncio
import sys

import msgspec
import pytest

from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.comparison import Comparison
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.recorded import Recorded, groups_of
from chefbotd.core.events import DutyWritten
from chefbotd.core.events.inputs import DaemonStarted, DaemonStopping, LinkBytesRead, TimerFired
from chefbotd.settings import load, packaged
from tests.chefbotd.components.recording.replay.recordings import recorded_of

READ = LinkBytesRead(5.0, "board", bytes(34))


def driven(duty: list[int], speed: float = 0.1, stamp_s: float = 5.0) -> bytes:
    """A control step as JSON."""
    return msgspec.json.encode({"stamp_s": stamp_s, "velocity_rad_s": [speed, 0.3], "duty": duty})


def test_what_is_the_same_is_counted() -> None:
    """Not a bit differs."""
    comparison = Comparison()
    told = driven([203, -201])
    comparison.add(READ, [Recorded(7, "WheelsDriven", told)], [("WheelsDriven", told)])
    comparison.finish()
    row = comparison.rows["WheelsDriven"]
    assert (row.recorded, row.replayed, row.differing) == (1, 1, 0)
    assert comparison.first is None


def test_another_order_of_the_fields_is_no_difference_and_another_kind_of_number_is_one() -> None:
    """A version may declare the fields anew; a zero below zero, and a whole number for a float, is another value."""
    recorded = [Recorded(7, "DutyWritten", b'{"stamp_s":5.0,"duty":[0.0]}')]
    same, other = Comparison(), Comparison()
    assert same.add(READ, recorded, [("DutyWritten", b'{"duty":[0.0],"stamp_s":5.0}')])
    assert same.first is None
    for text in (b"-0.0", b"0"):
        assert not other.add(READ, recorded, [("DutyWritten", b'{"stamp_s":5.0,"duty":[%b]}' % text)])
    assert str(other.first) == (
        'at 5.000000 s, after 34 bytes from board: DutyWritten: recorded DutyWritten {"stamp_s":5.0,"duty":[0.0]}, '
        'replayed DutyWritten {"stamp_s":5.0,"duty":[-0.0]}'
    )


def test_the_first_difference_has_both_values_to_the_last_bit() -> None:
    """The least difference that a number can have is one."""
    comparison = Comparison()
    recorded = [Recorded(7, "WheelsDriven", driven([203, -201], 0.1))]
    comparison.add(READ, recorded, [("WheelsDriven", driven([203, -201], 0.1 + 2**-56))])
    comparison.add(READ, recorded, [("WheelsDriven", driven([190, -201]))])
    assert str(comparison.first) == (
        "at 5.000000 s, after 34 bytes from board: WheelsDriven velocity_rad_s[0]: "
        "recorded 0.1, replayed 0.10000000000000002"
    )
    row = comparison.rows["WheelsDriven"]
    assert (row.differing, row.largest, row.field) == (2, 13, "duty[0]")


def test_an_event_too_many_or_too_few_is_a_difference() -> None:
    """It is told as a whole; what came in another entry with the same stamp is no difference of the table."""
    comparison = Comparison()
    early = Recorded(7, "WheelsDriven", driven([1, 2]))
    comparison.add(READ, [early], [])
    comparison.add(
        READ, [], [("WheelsDriven", driven([1, 2])), ("WheelsDriven", driven([3, 4], stamp_s=5.5))]
    )
    comparison.finish()
    assert comparison.first is not None
    assert comparison.first.replayed == "nothing"
    row = comparison.rows["WheelsDriven"]
    assert (row.recorded, row.replayed, row.differing) == (1, 2, 1)


def test_what_was_left_out_of_the_recording_is_not_compared() -> None:
    """Neither is what the recorder says of itself."""
    comparison = Comparison(["DutyWritten"])
    comparison.add(READ, [Recorded(7, "RecordingChanged", b"{}")], [])
    assert comparison.first is None
    assert not comparison.takes("DutyWritten")
    assert comparison.takes("WheelsDriven")


def test_entries_are_grouped_with_what_followed_up_to_the_end() -> None:
    """What comes before the first entry, and after the daemon's end, belongs to none."""
    events = [
        DutyWritten(0.5, (0, 0)),
        DaemonStarted(1.0, "armed", "started", None),
        LinkBytesRead(1.5, "board", b"e\t1\t2\n"),
        DutyWritten(1.5, (10, 20)),
        DutyWritten(1.5, (30, 40)),
        TimerFired(2.0, "drive watch"),
        DaemonStopping(2.5),
        TimerFired(3.0, "drive watch"),
    ]
    groups = list(groups_of(recorded_of(events)))
    assert [group.entry for group in groups] == [events[1], events[2], events[5]]
    assert [len(group.followers) for group in groups] == [0, 2, 0]


def test_the_last_entry_of_a_recording_that_was_cut_is_not_replayed() -> None:
    """Nobody knows whether all that followed it is there."""
    events = [DaemonStarted(1.0, "armed", "started", None), TimerFired(2.0, "a"), TimerFired(3.0, "b")]
    assert [group.entry for group in groups_of(recorded_of(events))] == events[:2]


def test_messages_that_are_missing_are_counted() -> None:
    """By the numbers of those around them: 2, 3 and 5 are not there."""
    events = [DaemonStarted(1.0, "armed", "started", None), TimerFired(2.0, "a"), TimerFired(3.0, "b")]
    stream = [
        Recorded(number, each.kind, each.payload)
        for number, each in zip((1, 4, 6), recorded_of(events), strict=True)
    ]
    assert [group.lost for group in groups_of(stream)] == [0, 2]


def test_what_the_robot_had_beside_it_is_not_needed_to_replay_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot with a lidar, Foxglove and an announcement, on a computer without their extras: nothing of them begins."""
    for package in ("foxglove", "zeroconf", "aiohttp", "numba", "scipy", "PIL"):
        monkeypatch.setitem(sys.modules, package, None)
    for room in ("foxglove.feature", "foxglove.server", "discovery.feature", "discovery.multicast"):
        monkeypatch.delitem(sys.modules, f"chefbotd.features.{room}", raising=False)
    settings = load(
        packaged("chefbot_lidar"), overrides={"foxglove.enabled": True, "discovery.enabled": True}
    )

    async def features() -> set[str]:
        return {each.name for each in replayed_daemon(settings, None, ReplayEntries()).features}

    there = asyncio.run(features())
    assert {"driving", "navigation", "lidars"} <= there
    assert not there & {"foxglove", "discovery"}
