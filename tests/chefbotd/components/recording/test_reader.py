"""Files that are no recordings are told apart, each with its name and what is wrong."""

import io
import random
import struct
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader

from chefbotd.components.recording.chunk import MAGIC
from chefbotd.components.recording.reader import CUT, RecordedMessage, RecordingReader
from chefbotd.components.recording.status import UnreadableRecording
from tests.chefbotd.components.recording.damage import damaged_chunk
from tests.chefbotd.components.recording.events import START_S, cycle, recorder


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


def recorded(folder: Path) -> bytes:
    """A recording of a second in chunks of a tenth."""
    made = recorder(folder, chunk_s=0.1)
    made.start("whole", START_S)
    for k in range(100):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    made.stop(START_S + 1.0)
    (path,) = folder.glob("*.mcap")
    return path.read_bytes()


def without_checksum(content: bytes) -> bytes:
    """The recording as it was written before it had a checksum: the record DataEnd has zeros in its place."""
    at = content.rindex(struct.pack("<BQ", Opcode.DATA_END, 4)) + 9
    return content[:at] + bytes(4) + content[at + 4 :]


def read(path: Path, content: bytes) -> tuple[list[RecordedMessage], str | None]:
    """What is read of this content, and what is said of it."""
    path.write_bytes(content)
    try:
        reader = RecordingReader(path)
        return list(reader.messages()), reader.problem
    except UnreadableRecording as problem:
        return [], str(problem)


def damaged(content: bytes, chance: random.Random) -> bytes:
    """The content with a bit or some bytes changed, zeroed, removed or added somewhere after its first bytes."""
    data, at = bytearray(content), chance.randrange(len(MAGIC), len(content))
    length = chance.choice([1, 4, 16, 64, 512, 4096])
    match chance.choice(["bit", "bytes", "zeros", "removed", "added"]):
        case "bit":
            data[at] ^= 1 << chance.randrange(8)
        case "bytes":
            data[at : at + length] = chance.randbytes(len(data[at : at + length]))
        case "zeros":
            data[at : at + length] = bytes(len(data[at : at + length]))
        case "removed":
            del data[at : at + length]
        case "added":
            data[at:at] = chance.randbytes(length)
    return bytes(data)


@pytest.mark.parametrize("is_old", [False, True], ids=["checksum", "no checksum"])
def test_no_damage_loses_or_changes_a_message_without_a_word(tmp_path: Path, is_old: bool) -> None:
    """Five hundred kinds of damage at random, also in files from before they had a checksum of the whole."""
    content = recorded(tmp_path)
    content = without_checksum(content) if is_old else content
    path = tmp_path / "damaged.mcap"
    whole, problem = read(path, content)
    assert (len(whole) > 100, problem) == (True, None)
    for seed in range(500):
        found, problem = read(path, damaged(content, random.Random(seed)))
        assert problem is not None or found == whole, f"seed {seed}"


def test_a_chunk_whose_kind_is_damaged_is_missed(tmp_path: Path) -> None:
    """It is passed over as of another kind; its index is added to that of the chunk before, of as many messages."""
    content = recorded(tmp_path)
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[3]
    changed = bytearray(content[: len(content) * 9 // 10])  # its end is missing, as after a power cut
    changed[chunk.chunk_start_offset] = 0x86  # a kind that others may use
    whole, _ = read(tmp_path / "a.mcap", content[: len(content) * 9 // 10])
    found, problem = read(tmp_path / "b.mcap", bytes(changed))
    lost = len(whole) - len(found)
    assert lost > 5
    assert problem == f"it is damaged: of {2 * lost} messages that an index names, {lost} are there"


def test_zeros_in_place_of_records_are_damage(tmp_path: Path) -> None:
    """A disk that lost a block gives zeros: nine of them look like a record of no kind and no length."""
    content = recorded(tmp_path)
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    first, after = (summary.chunk_indexes[k].chunk_start_offset for k in (3, 6))
    after -= (after - first) % 9
    _, problem = read(tmp_path / "zeros.mcap", content[:first] + bytes(after - first) + content[after:])
    assert problem == "it is damaged or was cut: there are zeros in place of a record"


def test_events_of_unknown_kinds_are_said(tmp_path: Path) -> None:
    """They are left out: of a newer version, or their name is damaged."""
    content = recorded(tmp_path).replace(b"chefbotd.WheelsDriven", b"chefbotd.WheelsDrivem")
    path = tmp_path / "unknown.mcap"
    path.write_bytes(without_checksum(content))
    reader = RecordingReader(path)
    assert not [event for event in reader.events() if type(event).__name__ == "WheelsDriven"]
    assert reader.problem is not None
    assert "left out: chefbotd.WheelsDrivem" in reader.problem


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
