"""A disk that is full, slow, hangs or vanishes costs what is recorded, and nothing else."""

import errno
import threading
import time
from pathlib import Path

import pytest

from chefbotd.components.recording.folder import RecordingDisk
from chefbotd.components.recording.reader import RecordingReader
from chefbotd.components.recording.recorder import Recorder
from chefbotd.components.recording.status import AUTOMATIC, RecordingError
from chefbotd.components.recording.writer import MOST_ASKED, WriterThread
from chefbotd.core.commands import RefusalKind
from tests.chefbotd.components.recording.disks import FailingDisk, FailingFile, SmallDisk
from tests.chefbotd.components.recording.events import START_S, cycle, fault, parts, recorder
from tests.waiting import PATIENCE_S

MEGABYTE = 1_000_000


def test_a_ring_that_the_disk_does_not_take_leaves_no_part_of_itself(tmp_path: Path) -> None:
    """It is refused with the reason, the folder is as before, and it can be written once there is room again."""
    disk = FailingDisk()
    made = recorder(tmp_path, disk, chunk_s=0.5)
    for k in range(200):
        made.record(cycle(START_S + k / 100), START_S + k / 100)

    closed: list[FailingFile] = []

    class Full(FailingFile):
        """On a disk that is full."""

        def write(self, data: bytes) -> None:
            """Nothing fits."""
            raise OSError(errno.ENOSPC, "told to fail")

        def close(self) -> None:
            """And it is counted, for whoever does not close it loses a descriptor each time."""
            closed.append(self)
            super().close()

    create = disk.create
    disk.create = lambda path: Full(disk, RecordingDisk.create(disk, path))  # type: ignore[method-assign]
    with pytest.raises(RecordingError, match="the disk is full"):
        made.save_ring("stalled", START_S + 2.0, fault=True)
    assert list(tmp_path.iterdir()) == []
    assert len(closed) == 1
    disk.create = create  # type: ignore[method-assign]
    saved = made.save_ring("stalled", START_S + 2.0, fault=True).saved
    assert [str(path) for path in tmp_path.iterdir()] == [saved]


@pytest.mark.parametrize(
    ("error", "told"), [(errno.ENOSPC, "the disk is full"), (errno.EIO, "the disk cannot be read or written")]
)
def test_a_disk_that_fails_ends_the_recording_with_whole_chunks(
    tmp_path: Path, error: int, told: str
) -> None:
    """Recording ends and says why. The file has what was whole, the ring goes on, and a new recording can begin."""
    disk = FailingDisk()
    made = recorder(tmp_path, disk, chunk_s=0.5)
    made.start("doomed", START_S)
    for k in range(200):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    disk.error = error
    for k in range(200, 400):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    assert made.status.state == "failed"
    assert told in made.status.reason
    disk.error = None
    with pytest.raises(RecordingError, match=told):
        made.stop(START_S + 4.0)
    reader = RecordingReader(next(tmp_path.glob("doomed*")))
    stamps = [event.stamp_s for event in reader.events() if type(event).__name__ == "WheelsDriven"]
    assert len(stamps) >= 150
    assert stamps == [START_S + k / 100 for k in range(len(stamps))]
    assert "its disk was full" in str(reader.problem)
    made.start("again", START_S + 5.0)
    assert made.status.state == "recording"
    assert made.stop(START_S + 6.0).state == "idle"
    assert made.save_ring("late", START_S + 6.0).ring_s > 3.5


@pytest.mark.parametrize(
    ("name", "error", "stopped", "goes_on"),
    [
        (AUTOMATIC, errno.ENOSPC, False, True),
        (AUTOMATIC, errno.ENOSPC, True, False),
        (AUTOMATIC, errno.EIO, False, False),
        ("evening", errno.ENOSPC, False, False),
    ],
)
def test_an_automatic_recording_goes_on_when_a_full_disk_has_room_again(
    tmp_path: Path, name: str, error: int, stopped: bool, goes_on: bool
) -> None:
    """It is tried every ten seconds. Not one that somebody asked for or has stopped, nor on a disk that is broken."""
    disk = FailingDisk()
    made = recorder(tmp_path, disk, chunk_s=0.5)
    made.start(name, START_S)
    states = []
    for k in range(300):
        disk.error = error if 20 <= k < 150 else None
        made.record(cycle(START_S + k / 10), START_S + k / 10)
        if k == 100 and stopped:
            with pytest.raises(RecordingError, match="nothing is being recorded"):
                made.stop(START_S + k / 10)
        states.append(made.status.state)
    assert (states[19], states[149], states[160]) == ("recording", "failed", "failed")
    assert states[-1] == ("recording" if goes_on else "failed")
    assert len(list(tmp_path.glob("*.mcap"))) == 1 + goes_on


def test_a_minimum_of_the_disk_stays_free(tmp_path: Path) -> None:
    """Recording ends in order before less is free, and none begins then; the message has both numbers."""
    disk = FailingDisk()
    made = recorder(tmp_path, disk, min_free_mb=500.0, chunk_s=0.5)
    disk.free = 501 * MEGABYTE
    made.start("tight", START_S)
    for k in range(200):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    disk.free = 499 * MEGABYTE
    for k in range(200, 400):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
    assert made.status.state == "failed"
    assert made.status.reason.startswith("only 499 MB of the disk are free, and 500 MB must stay free")
    reader = RecordingReader(next(tmp_path.glob("tight*")))
    assert len(list(reader.events())) >= 400
    assert reader.problem is None
    for begin in (lambda: made.start("more", START_S), lambda: made.save_ring("more", START_S)):
        with pytest.raises(RecordingError) as refused:
            begin()
        assert refused.value.kind is RefusalKind.STORAGE_FAILED


def test_on_a_full_disk_recording_goes_on_in_place_of_its_oldest_files(tmp_path: Path) -> None:
    """1 MB, 0.4 MB of it to stay free, two minutes in files of 0.1 MB: what somebody asked for stays."""
    asked_for, disk = tmp_path / "evening_20260412T183000Z.mcap", SmallDisk(1_000_000)
    asked_for.write_bytes(bytes(70_000))
    made = recorder(tmp_path, disk, min_free_mb=0.4, rotate_mb=0.1, chunk_s=0.5, ring_s=0.0)
    made.start(AUTOMATIC, START_S)
    written: list[Path] = []
    for k in range(12_000):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
        written += set(tmp_path.glob("auto_*")) - set(written)
    assert made.status.state == "recording"
    assert made.stop(START_S + 120.0).reason == ""
    left = set(tmp_path.glob("auto_*"))
    written += left - set(written)  # its end may have begun another one
    assert 2 <= len(left) < len(written)
    assert left == set(written[-len(left) :])
    assert all(RecordingReader(path).problem is None for path in left)
    assert asked_for.exists()
    assert 0.25e6 < disk.least < 0.4e6  # a second of recording more than was to be
    assert disk.free_bytes(tmp_path) >= 0.35e6


def test_no_file_is_removed_where_that_would_not_help(tmp_path: Path) -> None:
    """Others fill the disk: recording ends with the reason, and every file stays."""
    disk = SmallDisk(1_000_000)
    made = recorder(tmp_path, disk, min_free_mb=0.4, rotate_mb=0.1, chunk_s=0.5, ring_s=0.0)
    made.start(AUTOMATIC, START_S)
    for k in range(6_000):
        made.record(cycle(START_S + k / 100), START_S + k / 100)
        if k == 2_000:
            files, disk.capacity = set(tmp_path.glob("auto_*")), 300_000
    assert made.status.state == "failed"
    assert "must stay free" in made.status.reason
    assert set(tmp_path.glob("auto_*")) >= files
    assert len(files) > 1


def test_the_oldest_files_that_nobody_asked_for_give_way(tmp_path: Path) -> None:
    """Together they stay below their bound; what somebody asked for stays, and so does the newest."""
    made = recorder(tmp_path, automatic_mb=1.0)
    for age, name in enumerate(["auto_a", "fault_b", "auto_c", "kept_d"]):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(bytes(400_000))
        past_s = time.time() - 100 + age
        __import__("os").utime(path, (past_s, past_s))
    made.record(cycle(START_S), START_S)
    made.save_ring("newest", START_S + 1.0)
    left = {path.name.split("_")[1].partition(".")[0] for path in tmp_path.glob("*.mcap")}
    assert left == {"b", "c", "d", "newest"}


@pytest.mark.parametrize("where", ["no_permission", "file_in_the_way"])
def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path, where: str) -> None:
    """The reason and the folder are in the message."""
    (tmp_path / "file").write_text("in the way")
    disk = FailingDisk()
    disk.error = errno.EACCES if where == "no_permission" else None
    folder = tmp_path / ("inner" if disk.error else "file/inner")
    made = recorder(folder, disk)
    with pytest.raises(RecordingError, match=str(folder)):
        made.start("x", START_S)
    assert not list(tmp_path.rglob("*.mcap"))


def in_thread(folder: Path, disk: FailingDisk, most_bytes: int) -> WriterThread:
    """A recorder in its thread."""
    writer = WriterThread(lambda: parts(folder, disk, kind=Recorder, chunk_s=0.05), most_bytes)
    writer.ready.result(PATIENCE_S)
    return writer


def settle(writer: WriterThread) -> None:
    """Wait until all that was left is taken."""
    writer.ask(lambda made: made.status, START_S).result(PATIENCE_S)


def test_nobody_waits_for_a_disk_that_hangs(tmp_path: Path) -> None:
    """While a write hangs, leaving events takes microseconds; what finds no room is counted, and the file says where."""
    disk = FailingDisk()
    writer = in_thread(tmp_path, disk, most_bytes=100_000)
    writer.ask(lambda made: made.start("hung", START_S), START_S).result(PATIENCE_S)
    writer.put_events(cycle(START_S), START_S)
    settle(writer)
    disk.goes_on.clear()
    writer.put_events(cycle(START_S + 0.1), START_S + 0.1)
    assert disk.entered.wait(PATIENCE_S)
    slowest_s = 0.0
    for k in range(3000):
        began_s = time.thread_time()  # of the processor: who waits for the disk here never comes back
        writer.put_events(cycle(START_S + 0.2 + k / 100), START_S + 0.2 + k / 100)
        slowest_s = max(slowest_s, time.thread_time() - began_s)
    assert slowest_s < 0.1
    dropped, waiting = writer.dropped, writer.waiting
    assert 5990 < waiting + dropped <= 6002
    assert 50 < waiting < 1500
    disk.goes_on.set()
    settle(writer)
    assert writer.waiting == 0
    writer.put_events(cycle(START_S + 20.0), START_S + 20.0)
    writer.ask(lambda made: made.stop(START_S + 21.0), START_S).result(PATIENCE_S)
    reader = RecordingReader(next(tmp_path.glob("hung*")))
    events = list(reader.events())
    gaps = [event.count for event in events if type(event).__name__ == "EventsDropped"]
    assert gaps == [writer.dropped]
    assert len(events) - len(gaps) == 6006 - writer.dropped
    assert reader.problem is None


def test_a_question_to_a_hung_disk_can_be_given_up(tmp_path: Path) -> None:
    """Whoever asked may cancel: what had not begun is never done, also when the disk is back."""
    disk = FailingDisk()
    writer = in_thread(tmp_path, disk, most_bytes=100_000)
    settle(writer)
    disk.goes_on.clear()
    hanging = writer.ask(lambda made: made.start("first", START_S), START_S)
    assert disk.entered.wait(PATIENCE_S)
    given_up = writer.ask(lambda made: made.save_ring("second", START_S), START_S)
    assert given_up.cancel()
    disk.goes_on.set()
    assert hanging.result(PATIENCE_S).state == "recording"
    settle(writer)
    assert not list(tmp_path.glob("fault*"))


def test_questions_to_a_hung_disk_do_not_pile_up(tmp_path: Path) -> None:
    """64 wait, given up or not; more are refused at once, until the disk is back."""
    disk = FailingDisk()
    writer = in_thread(tmp_path, disk, most_bytes=100_000)
    settle(writer)
    disk.goes_on.clear()
    hanging = writer.ask(lambda made: made.start("first", START_S), START_S)
    assert disk.entered.wait(PATIENCE_S)
    waiting = [writer.ask(lambda made: made.status, START_S) for _ in range(MOST_ASKED)]
    assert all(each.cancel() for each in waiting)
    with pytest.raises(RecordingError, match="did not answer"):
        writer.ask(lambda made: made.status, START_S).result(0.0)
    disk.goes_on.set()
    assert hanging.result(PATIENCE_S).state == "recording"
    deadline_s = time.monotonic() + PATIENCE_S
    while (served := writer.ask(lambda made: made.status, START_S)).done() and served.exception():
        assert time.monotonic() < deadline_s
    assert served.result(PATIENCE_S).state == "recording"


def test_a_recorder_that_fails_inside_goes_on(tmp_path: Path) -> None:
    """An event that cannot be written takes nothing with it."""
    writer = in_thread(tmp_path, FailingDisk(), most_bytes=100_000)
    writer.ask(lambda made: made.start("odd", START_S), START_S).result(PATIENCE_S)
    writer.put_events([object()], START_S)
    writer.put_events([fault(START_S)], START_S)
    writer.ask(lambda made: made.stop(START_S + 1.0), START_S).result(PATIENCE_S)
    events = list(RecordingReader(next(tmp_path.glob("odd*"))).events())
    assert events == [fault(START_S)]
    assert threading.active_count() >= 1
