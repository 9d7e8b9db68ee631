"""Files that are no recordings are told apart, each with its name and what is wrong."""

from pathlib import Path

import pytest

from chefbotd.recording.chunk import MAGIC
from chefbotd.recording.reader import CUT, RecordingReader
from chefbotd.recording.status import UnreadableRecording
from tests.chefbotd.recording.damage import damaged_chunk
from tests.chefbotd.recording.events import START_S, cycle, recorder


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"hello", "is not an MCAP file"),
        (MAGIC[:5], "ends after 5 bytes"),
        (b"\x1f\x8b" + bytes(500), "is not an MCAP file"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, told: str) -> None:
    """Before anything is read of it."""
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(UnreadableRecording, match=told) as refused:
        RecordingReader(path)
    assert str(path) in str(refused.value)


def test_a_folder_and_a_missing_file_are_told(tmp_path: Path) -> None:
    """With what was expected."""
    with pytest.raises(UnreadableRecording, match="is a folder, expected a recording"):
        RecordingReader(tmp_path)
    with pytest.raises(UnreadableRecording, match="No such file"):
        RecordingReader(tmp_path / "absent.mcap")


def test_damage_in_the_middle_ends_the_reading_and_is_told(tmp_path: Path) -> None:
    """What stands before the damaged chunk comes back; the checksum of the chunk is held against its content."""
    made = recorder(tmp_path, chunk_s=0.1)
    made.start("damaged", START_S)
    for k in range(300):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    made.stop(START_S + 3.0)
    (path,) = tmp_path.glob("*.mcap")
    path.write_bytes(damaged_chunk(path.read_bytes()))
    reader = RecordingReader(path)
    found = [event for event in reader.events() if type(event).__name__ == "WheelsDriven"]
    assert reader.problem is not None
    assert "damaged" in reader.problem
    assert 20 < len(found) < 300
    assert [event.stamp_s for event in found] == [START_S + k / 100 for k in range(len(found))]


@pytest.mark.parametrize("beyond", [1, 5, 9, 12])
def test_a_file_that_ends_within_a_record_was_cut(tmp_path: Path, beyond: int) -> None:
    """Whether within the record's head, of an opcode and eight bytes of length, at its end, or in the content."""
    made = recorder(tmp_path, chunk_s=0.1)
    made.start("cut", START_S)
    for k in range(100):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    made.stop(START_S + 1.0)
    (path,) = tmp_path.glob("*.mcap")
    content, heads = path.read_bytes(), [len(MAGIC)]
    while heads[-1] < len(content) - len(MAGIC):
        at = heads[-1]
        heads.append(at + 9 + int.from_bytes(content[at + 1 : at + 9], "little"))
    path.write_bytes(content[: heads[len(heads) // 2] + beyond])
    reader = RecordingReader(path)
    assert "WheelsDriven" in [type(event).__name__ for event in reader.events()]
    assert reader.problem == CUT
