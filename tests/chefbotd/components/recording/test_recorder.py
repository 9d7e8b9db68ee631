"""What is recorded comes back, in files that any reader of MCAP can read."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import pytest
from mcap.reader import make_reader

from chefbotd.components.recording.encoder import schema_of
from chefbotd.components.recording.reader import RecordingReader
from chefbotd.components.recording.status import RecordingError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events import LineSeen
from chefbotd.core.events.robot import EventsDropped
from chefbotd.core.geometry import Pose2D
from chefbotd.event_classes import class_of, event_names
from tests.chefbotd.components.recording.events import START_S, WALL_S, cycle, example, fault, recorder


def files_in(folder: Path) -> list[Path]:
    """Every recording, the oldest name first."""
    return sorted(folder.glob("*.mcap"))


def read(path: Path) -> list[Any]:
    """Every event of a file."""
    return list(RecordingReader(path).events())


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_what_was_recorded_comes_back_exactly(tmp_path: Path, compression: str) -> None:
    """Every event is equal to the one that was published, to the last bit, and in the same order."""
    made = recorder(tmp_path, compression=compression)
    events = [event for k in range(300) for event in cycle(START_S + k / 97)]
    made.start("drive", START_S)
    for event in events:
        made.record([event], event.stamp_s)
    made.stop(START_S + 4.0)
    (path,) = files_in(tmp_path)
    reader = RecordingReader(path)
    assert list(reader.events()) == events
    assert reader.problem is None
    assert reader.metadata["chefbotd"] == {"robot": "kitchen-bot"}
    assert reader.attachments == {"robot.urdf": b"<robot name='kitchen-bot'/>"}


def test_the_library_reads_it_by_its_index(tmp_path: Path) -> None:
    """The summary counts every message, and a seek finds those of a time: 1 s later is 1e9 ns after the start."""
    made = recorder(tmp_path, chunk_s=0.5)
    made.start("drive", START_S)
    for k in range(300):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    made.stop(START_S + 3.0)
    (path,) = files_in(tmp_path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        topics = {channel.topic: number for number, channel in summary.channels.items()}
        counts = summary.statistics.channel_message_counts
        assert counts[topics["/events/WheelsDriven"]] == 300
        assert summary.statistics.chunk_count >= 5
        begin_ns = round(WALL_S * 1e9)
        found = [
            json.loads(message.data)["stamp_s"] - START_S
            for _, _, message in reader.iter_messages(
                "/events/WheelsDriven",
                starting_at=begin_ns + 1_000_000_000,
                ending_before=begin_ns + 1_100_000_000,
            )
        ]
    assert found == pytest.approx([1.0 + k / 100 for k in range(10)], abs=1e-9)


def test_every_class_of_events_has_a_schema_that_holds(tmp_path: Path) -> None:
    """An event of each class is valid by the schema in the file, which refers to nothing outside, and comes back.

    One that says how it is recorded (a camera's picture, without its bytes) comes back so.
    """
    made = recorder(tmp_path)
    events = [example(class_of(name) or int) for name in sorted(event_names())]
    assert len(events) > 40
    made.start("all", START_S)
    made.record(events, START_S)
    made.stop(START_S + 1.0)
    (path,) = files_in(tmp_path)
    checked = set[str]()
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            rule = json.loads(schema.data)
            assert rule["type"] == "object", channel.topic
            assert "$ref" not in schema.data.decode(), channel.topic
            jsonschema.validate(json.loads(message.data), rule)
            checked.add(schema.name)
    assert checked >= {f"chefbotd.{name}" for name in event_names()}
    scans = [each for each in read(path) if type(each).__name__ == "ScanMeasured"]
    assert [each for each in read(path) if type(each).__name__ != "ScanMeasured"] == [
        msgspec.json.decode(each.encode_recorded(), type=type(each))
        if hasattr(each, "encode_recorded")
        else each
        for each in events
        if type(each).__name__ != "ScanMeasured"
    ]
    (original,) = [each for each in events if type(each).__name__ == "ScanMeasured"]
    assert scans[0].base_from_lidar == Pose2D(0.1, -0.02, 0.3)
    assert scans[0].scan.range_m.tolist() == original.scan.range_m.tolist()


def test_a_schema_says_what_an_event_must_have() -> None:
    """A line without its time is refused by the schema of lines."""
    with pytest.raises(jsonschema.ValidationError, match="stamp_s"):
        jsonschema.validate({"direction": "in", "line": ""}, schema_of(LineSeen))


def test_a_killed_recorder_leaves_what_it_had_written(tmp_path: Path) -> None:
    """After kill -9 in the middle everything up to the last chunk can be read, and the reader says that it was cut."""
    program = textwrap.dedent(
        f"""
        import sys
        from pathlib import Path
        from tests.chefbotd.components.recording.events import START_S, cycle, recorder
        made = recorder(Path({str(tmp_path)!r}), chunk_s=0.1)
        made.start("killed", START_S)
        k = 0
        while True:
            made.record(cycle(START_S + k / 100), START_S + k / 100)
            k += 1
            if k == 2000:
                print("now", flush=True)
        """
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        os.kill(process.pid, signal.SIGKILL)
    (path,) = files_in(tmp_path)
    reader = RecordingReader(path)
    stamps = [event.stamp_s for event in reader.events() if type(event).__name__ == "WheelsDriven"]
    assert len(stamps) > 1900
    assert stamps == [START_S + k / 100 for k in range(len(stamps))]
    assert reader.problem is not None


@pytest.mark.parametrize("cut", [1, 7, 300, 5000])
def test_a_file_that_was_cut_anywhere_is_read_up_to_its_last_chunk(tmp_path: Path, cut: int) -> None:
    """Whatever is missing at its end, what comes back is a beginning of what was recorded."""
    made = recorder(tmp_path, chunk_s=0.05)
    events = [event for k in range(300) for event in cycle(START_S + k / 100)]
    made.start("cut", START_S)
    for event in events:
        made.record([event], event.stamp_s)
    made.stop(START_S + 3.0)
    (path,) = files_in(tmp_path)
    path.write_bytes(path.read_bytes()[:-cut])
    reader = RecordingReader(path)
    found = list(reader.events())
    assert found == events[: len(found)]
    assert len(found) > 250
    assert reader.problem is not None


def test_a_file_is_rotated_by_size(tmp_path: Path) -> None:
    """Beyond its size another file goes on; each can be read alone, and together they have every event once."""
    made = recorder(tmp_path, rotate_mb=0.1, chunk_s=0.05)
    events = [event for k in range(6000) for event in cycle(START_S + k / 100)]
    made.start("long", START_S)
    for event in events:
        made.record([event], event.stamp_s)
    ended = made.stop(START_S + 60.0)
    paths = sorted(files_in(tmp_path), key=lambda path: (len(path.name), path.name))
    assert len(paths) >= 3
    assert [event for path in paths for event in read(path)] == events
    assert all(path.stat().st_size < 150_000 for path in paths)
    assert ended.bytes_written == sum(path.stat().st_size for path in paths)


def test_a_file_is_rotated_by_age_and_begins_with_what_holds(tmp_path: Path) -> None:
    """After its minutes another file goes on. In it the mode of the gate is told again, as no new event."""
    made = recorder(tmp_path, rotate_minutes=0.5, chunk_s=1.0)
    made.start("old", START_S)
    made.record([fault(START_S)], START_S)
    for k in range(1, 70):
        made.record(cycle(START_S + k), START_S + k)
    made.stop(START_S + 70.0)
    first, second, third = sorted(files_in(tmp_path), key=lambda path: (len(path.name), path.name))
    assert third.name.endswith("_part3.mcap")
    assert sum(type(each).__name__ == "SafetyChanged" for each in read(first)) == 1
    assert not any(type(each).__name__ == "SafetyChanged" for each in read(second))
    topics = [message.topic for message in RecordingReader(second).messages()]
    assert topics[0] == "/events/SafetyChanged"


def test_the_ring_keeps_the_last_seconds_and_no_more_bytes(tmp_path: Path) -> None:
    """Of 60 s a ring of 10 s writes the last 10 to 11; a smaller bound in bytes holds first."""
    made = recorder(tmp_path, ring_s=10.0, chunk_s=0.5)
    for k in range(6000):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    saved = made.save_ring("stalled", START_S + 60.0, fault=True)
    stamps = [event.stamp_s for event in read(Path(str(saved.saved)))]
    assert 10.0 <= stamps[-1] - stamps[0] < 11.1
    assert stamps[-1] == pytest.approx(START_S + 59.99)
    assert Path(str(saved.saved)).name.startswith("fault_stalled_")

    small = recorder(tmp_path, ring_s=3600.0, ring_mb=0.1, chunk_s=0.5)
    for k in range(6000):
        small.record(cycle(START_S + k / 100), START_S + k / 100)
    assert 50_000 < small.status.ring_bytes <= 100_000


def test_a_gap_is_said_where_it_is(tmp_path: Path) -> None:
    """Between the events before it and after it stands how many are missing, also in the log for people."""
    made = recorder(tmp_path)
    made.start("gap", START_S)
    made.record(cycle(START_S), START_S)
    made.note_gap(17, "the disk was too slow", START_S + 1.0)
    made.record(cycle(START_S + 2.0), START_S + 2.0)
    made.stop(START_S + 3.0)
    (path,) = files_in(tmp_path)
    names = [type(each).__name__ for each in read(path)]
    assert names.index("EventsDropped") == 2
    assert read(path)[2] == EventsDropped(START_S + 1.0, 17, "the disk was too slow")
    said = [
        json.loads(each.data)["message"] for each in RecordingReader(path).messages() if each.topic == "/log"
    ]
    numbers = [
        each.sequence for each in RecordingReader(path).messages() if each.topic.startswith("/events/")
    ]
    assert numbers == [1, 2, 20, 21, 22]
    assert said == ["17 events are missing: the disk was too slow"]


def test_one_recording_at_a_time(tmp_path: Path) -> None:
    """A second start is refused and harms nothing; so is an end of nothing."""
    made = recorder(tmp_path)
    with pytest.raises(RecordingError) as refused:
        made.stop(START_S)
    assert refused.value.kind is RefusalKind.NOT_RECORDING
    made.start("one", START_S)
    with pytest.raises(RecordingError) as refused:
        made.start("two", START_S)
    assert refused.value.kind is RefusalKind.ALREADY_RECORDING
    made.record(cycle(START_S), START_S)
    made.stop(START_S + 1.0)
    (path,) = files_in(tmp_path)
    assert len(read(path)) == 2


@pytest.mark.parametrize("name", ["", "a/b", "../up", ".hidden", "-dash", "x" * 65, "new\nline"])
def test_a_name_that_is_no_file_name_is_refused(tmp_path: Path, name: str) -> None:
    """Nothing is written, least of all outside the folder."""
    made = recorder(tmp_path / "inner")
    with pytest.raises(RecordingError) as refused:
        made.start(name, START_S)
    assert refused.value.kind is RefusalKind.BAD_NAME
    assert list(tmp_path.rglob("*.mcap")) == []


def test_two_recordings_of_one_name_and_second_are_two_files(tmp_path: Path) -> None:
    """Nothing that was recorded is written over."""
    made = recorder(tmp_path)
    for _ in range(3):
        made.start("same", START_S)
        made.record(cycle(START_S), START_S)
        made.stop(START_S + 1.0)
    assert len(files_in(tmp_path)) == 3
    assert {len(read(path)) for path in files_in(tmp_path)} == {2}


def test_files_are_listed_with_what_is_wrong(tmp_path: Path) -> None:
    """A file that was cut is not complete, the one that is being written is told."""
    made = recorder(tmp_path)
    made.start("whole", START_S)
    made.record(cycle(START_S), START_S)
    made.stop(START_S + 1.0)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(files_in(tmp_path)[0].read_bytes()[:-3])
    made.start("running", START_S)
    rows = {row.file.partition("_")[0]: row for row in made.list_files()}
    assert rows["whole"].complete
    assert not rows["cut.mcap"].complete
    assert rows["running"].recording
    assert not rows["whole"].recording
