"""Recording over the socket: the whole daemon with the simulated robot, on a virtual clock and with real files."""

import asyncio
import errno
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.recording.build import StartWriter
from chefbotd.components.recording.chunk_encoder import ChunkEncoder
from chefbotd.components.recording.parameters import RecordingParameters, folder_of
from chefbotd.components.recording.reader import RecordingReader
from chefbotd.components.recording.recorder import Recorder
from chefbotd.components.recording.writer import InlineWriter, MakeRecorder
from chefbotd.settings import Settings, SettingsError, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.recording import write_inline
from tests.chefbotd.components.recording.disks import FailingDisk
from tests.robot_files import full

TOKEN = "5a1d" * 12


def settings(folder: Path, **changed: Any) -> Settings:
    """The packaged ChefBot, whose recordings are in this folder."""
    parameters = RecordingParameters(folder=folder, min_free_mb=0.0, **changed)
    return load().model_copy(update={"recording": parameters})


def read(path: str | Path) -> list[Any]:
    """Every event of a file, which must be whole."""
    reader = RecordingReader(Path(path))
    events = list(reader.events())
    assert reader.problem is None
    return events


def names(events: list[Any]) -> set[str]:
    """The classes of these events."""
    return {type(event).__name__ for event in events}


def files(folder: Path) -> list[Path]:
    """Every recording."""
    return sorted(folder.glob("*.mcap"))


def size(path: str) -> int:
    """Bytes of a file."""
    return Path(path).stat().st_size


async def drive(robot: SimulatedRobot, seconds: float) -> None:
    """Go on an arc."""
    for _ in range(round(seconds / 0.1)):
        await robot.client.drive(0.13, 0.4)
        await asyncio.sleep(0.1)


def test_a_drive_is_recorded_with_what_came_in_and_went_out(tmp_path: Path) -> None:
    """The bytes of the board, both ways, requests with their client, and every event stand in the file, in one order."""

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            started = await robot.client.start_recording("arc")
            assert Path(started.file).parent == tmp_path
            await drive(robot, 2.0)
            ended = await robot.client.stop_recording()
            assert ended.dropped == 0
            assert ended.size_bytes == size(ended.file)
            assert ended.seconds == pytest.approx(2.0, abs=0.2)
            events = read(ended.file)
            assert names(events) >= {
                "LinkBytesRead", "LinkBytesWritten", "RequestHandled", "EncodersCounted", "WheelsDriven",
                "OdometryUpdated", "DutyWritten", "StatsSampled", "RecordingChanged",
            }  # fmt: skip
            assert "LineSeen" not in names(events)
            came = b"".join(event.data for event in events if type(event).__name__ == "LinkBytesRead")
            went = b"".join(event.data for event in events if type(event).__name__ == "LinkBytesWritten")
            assert came.count(b"e\t") >= 38
            assert went.startswith(b"s ")
            drives = [event for event in events if getattr(event, "method", "") == "drive"]
            assert len(drives) == 20
            assert {"linear_m_s": 0.13, "angular_rad_s": 0.4}.items() <= drives[0].params.items()
            order = [type(event).__name__ for event in events]
            first = next(k for k, event in enumerate(events) if b"e\t" in getattr(event, "data", b""))
            assert "EncodersCounted" not in order[:first]
            assert order[first + 1] == "EncodersCounted"

    run_virtual(main())


def test_a_fault_writes_the_minutes_before_it_and_seconds_after_it(tmp_path: Path) -> None:
    """The file is named after the fault, reaches from long before it to three seconds after, and the socket tells it."""

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 5.0)
            robot.device.unplug()
            await asyncio.sleep(4.0)
            (path,) = files(tmp_path)
            assert path.name.startswith("fault_link_lost_")
            events = read(path)
            (fault,) = [event for event in events if getattr(event, "fault", None) == "link_lost"][:1]
            assert fault.stamp_s - events[0].stamp_s > 5.0
            assert 2.9 < events[-1].stamp_s - fault.stamp_s < 3.3
            state = await robot.client.call("get_state")
            assert state["topics"]["recording"]["data"]["saved"] == str(path)
            stats = await robot.client.call("get_stats")
            assert stats["recording_faults_saved"] == 1
            assert stats["recording_dropped"] == 0
            assert stats["recording_ring_bytes"] > 1000

    run_virtual(main())


def test_a_stop_by_somebody_is_no_fault(tmp_path: Path) -> None:
    """An e-stop writes nothing; whoever wants the last minutes asks for them."""

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 1.0)
            await robot.client.estop("a child")
            await asyncio.sleep(6.0)
            assert files(tmp_path) == []
            saved = await robot.client.save_ring("odd noise")
            assert Path(saved.file).name.startswith("ring_odd noise_")
            assert any(getattr(event, "method", "") == "estop" for event in read(saved.file))

    run_virtual(main())


def test_a_recording_that_begins_by_itself_has_the_start(tmp_path: Path) -> None:
    """With ``auto_start`` the first event is the daemon's own start, before the board was touched."""

    async def main() -> None:
        made = settings(tmp_path, auto_start=True, ring_s=0.0)
        async with simulated_robot(made, start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 1.0)
            rows = (await robot.client.list_recordings()).files
            assert [row.recording for row in rows] == [True]

    run_virtual(main())
    (path,) = tmp_path.glob("auto_*.mcap")
    events = read(path)
    assert type(events[0]).__name__ == "DaemonStarted"
    order = [type(event).__name__ for event in events]
    assert order.index("PortOpened") < order.index("LinkBytesRead")
    assert "DaemonStopping" in order


def test_a_robot_that_keeps_no_ring_drops_no_event_by_itself(tmp_path: Path) -> None:
    """280 changes of the gate's state: nobody waits for them to save the ring, so none is counted as lost."""

    async def main() -> None:
        async with simulated_robot(settings(tmp_path, ring_s=0.0), start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            for _ in range(140):
                await robot.client.estop("again")
                await robot.client.arm()
            assert (await robot.client.get_stats()).bus_dropped == {}

    run_virtual(main())


def test_a_robot_that_keeps_no_ring_pays_for_nothing(tmp_path: Path) -> None:
    """Without a ring nothing that comes in is published until somebody records, nor after the end of the recording."""

    async def main() -> None:
        made = settings(tmp_path, ring_s=0.0)
        async with simulated_robot(made, start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            assert not robot.daemon.entries.recording
            with pytest.raises(CallError, match="switched off in its configuration") as refused:
                await robot.client.save_ring()
            assert refused.value.kind == "storage_failed"
            with pytest.raises(CallError) as refused:
                await robot.client.stop_recording()
            assert refused.value.kind == "not_recording"
            with pytest.raises(CallError) as refused:
                await robot.client.start_recording("no/name")
            assert refused.value.kind == "bad_name"
            assert not robot.daemon.entries.recording
            await robot.client.start_recording()
            assert robot.daemon.entries.recording
            with pytest.raises(CallError) as refused:
                await robot.client.start_recording()
            assert refused.value.kind == "already_recording"
            assert robot.daemon.entries.recording
            await asyncio.sleep(0.5)
            ended = await robot.client.stop_recording()
            assert not robot.daemon.entries.recording
            assert len(read(ended.file)) > 50

    run_virtual(main())


def test_classes_that_are_left_out_are_not_recorded(tmp_path: Path) -> None:
    """What the configuration names is not in the file, and nothing else is missing."""

    async def main() -> None:
        made = settings(tmp_path, exclude=frozenset({"WheelsDriven", "LinkBytesRead"}))
        async with simulated_robot(made, start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            ended_names = names(read((await robot.client.save_ring()).file))
            assert "WheelsMeasured" in ended_names
            assert not ended_names & {"WheelsDriven", "LinkBytesRead"}

    run_virtual(main())


def test_no_secret_is_in_a_recording(tmp_path: Path) -> None:
    """The token with which a client came in stands nowhere in the file: not in it as it is, nor in what is unpacked."""
    tokens = tmp_path / "tokens"
    tokens.write_text(f"admin {TOKEN}\n")
    tokens.chmod(0o600)

    async def main() -> str:
        made = settings(tmp_path / "recordings", auto_start=True)
        made = made.model_copy(update={"api": made.api.model_copy(update={"token_file": tokens})})
        async with simulated_robot(made, token=TOKEN, start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 0.5)
            return (await robot.client.stop_recording()).file

    path = Path(run_virtual(main()))
    reader = RecordingReader(path)
    unpacked = b"".join(message.data for message in reader.messages())
    assert b'"drive"' in unpacked
    assert b"authenticate" in unpacked
    about = repr(reader.metadata) + repr(reader.attachments)
    assert "token_file" in about
    for part in (path.read_bytes(), unpacked, about.encode()):
        assert TOKEN.encode() not in part


def test_the_configuration_and_the_description_are_in_the_file(tmp_path: Path) -> None:
    """The configuration can be used again as it is, and the URDF is the one that the socket gives."""

    async def main() -> tuple[str, str]:
        async with simulated_robot(settings(tmp_path), start_writer=write_inline) as robot:
            await robot.client.wait_until_armed()
            urdf = (await robot.client.call("get_description"))["urdf"]
            return (await robot.client.save_ring()).file, urdf

    path, urdf = run_virtual(main())
    reader = RecordingReader(Path(path))
    reader.read_about()
    again = Settings.model_validate_json(reader.metadata["configuration"]["json"])
    assert again.chassis == load().chassis
    assert again.recording.folder == tmp_path
    assert reader.attachments["robot.urdf"].decode() == urdf
    assert reader.metadata["chefbotd"]["robot"] == "chefbot"
    assert "mcap" in reader.metadata["packages"]


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        (
            {"STATE_DIRECTORY": "/var/lib/chefbotd:/var/lib/more", "XDG_STATE_HOME": "/x"},
            "/var/lib/chefbotd/recordings",
        ),
        ({"XDG_STATE_HOME": "/home/ann/state"}, "/home/ann/state/chefbotd/recordings"),
        ({"XDG_STATE_HOME": "relative"}, "/home/ann/.local/state/chefbotd/recordings"),
    ],
)
def test_where_recordings_are_when_nothing_says_so(
    environment: dict[str, str], folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Systemd's folder first, then XDG's, which counts only where it is absolute; a simulated robot's are apart."""
    monkeypatch.setenv("HOME", "/home/ann")
    assert folder_of(RecordingParameters(), environment) == Path(folder)
    simulated = folder_of(RecordingParameters(), environment, simulated=True)
    assert simulated == Path(folder).with_name("simulated_recordings")
    assert folder_of(RecordingParameters(folder=Path("/mnt/ssd")), environment) == Path("/mnt/ssd")


def test_a_class_that_there_is_not_is_refused(tmp_path: Path) -> None:
    """A misspelt name in ``exclude`` would record what somebody wanted left out."""
    path = tmp_path / "robot.toml"
    path.write_text(full().read_text() + '\n[recording]\nexclude = ["ScanMeasured", "ScansMeasured"]\n')
    with pytest.raises(SettingsError, match="there is no class of events 'ScansMeasured'"):
        load(path)


def on_disk(disk: FailingDisk) -> StartWriter:
    """Records on this disk."""

    def start(make: MakeRecorder, most_bytes: int) -> InlineWriter:
        def made() -> tuple[ChunkEncoder, Recorder]:
            encoder, recorder = make()
            recorder._disk = recorder._folder._disk = disk
            return encoder, recorder

        return write_inline(made, most_bytes)

    return start


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suddenly", "told"), [(True, "the disk is full"), (False, "1 MB of the disk are free")]
)
def test_an_automatic_recording_goes_on_when_a_full_disk_has_room_again(
    tmp_path: Path, suddenly: bool, told: str
) -> None:
    """Full in the middle of a write, or below ``min_free_mb``: a new file has what comes after, and can be replayed.

    Both ends are in the log, once each. What was recorded before can be read.
    """
    disk = FailingDisk()
    disk.free = 900_000_000

    async def main() -> None:
        parameters = RecordingParameters(folder=tmp_path, auto_start=True)
        made = load().model_copy(update={"recording": parameters})
        async with simulated_robot(made, start_writer=on_disk(disk)) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 3.0)
            disk.error, disk.free = (errno.ENOSPC, disk.free) if suddenly else (None, 1_000_000)
            await drive(robot, 13.0)
            status = (await robot.client.call("get_state"))["topics"]["recording"]["data"]
            assert (status["state"], len(files(tmp_path))) == ("failed", 1)
            assert status["reason"].endswith("a new file begins when it has room")
            disk.error, disk.free = None, 600_000_000
            await drive(robot, 13.0)
            status = (await robot.client.call("get_state"))["topics"]["recording"]["data"]
            assert (status["state"], status["reason"]) == ("recording", "")

    with capture_logs() as log:
        run_virtual(main())
    first, second = sorted(files(tmp_path), key=lambda path: path.stat().st_mtime)
    before, after = list(RecordingReader(first).events()), read(second)
    assert after[0].stamp_s - before[-1].stamp_s > 13.0
    assert "StateRecorded" in names(after)
    assert [line["reason"].count(told) for line in log if line["event"] == "recording has a problem"] == [1]
    assert [line["file"] for line in log if line["event"] == "recording goes on"] == [str(second)]


def test_a_recorder_that_cannot_start_keeps_nobody_from_driving(tmp_path: Path) -> None:
    """Such as with a library that is broken: it is logged, and whoever asks for a recording is told why."""

    def broken(make: MakeRecorder, most_bytes: int) -> InlineWriter:
        raise ImportError("no zstandard for this processor")

    async def main() -> None:
        async with simulated_robot(settings(tmp_path), start_writer=broken) as robot:
            await robot.client.wait_until_armed()
            await drive(robot, 0.5)
            with pytest.raises(CallError, match=r"cannot start.*no zstandard for this processor"):
                await robot.client.start_recording("evening")
            await drive(robot, 1.0)
            assert (await robot.client.get_state()).safety.mode == "armed"
            assert abs(robot.board.truth(0.0).world_from_base.x_m) > 0.05

    with capture_logs() as log:
        run_virtual(main())
    assert [line["event"] for line in log if line["log_level"] == "warning"] == ["nothing is recorded"]
    assert files(tmp_path) == []


def test_a_disk_that_is_full_is_told_once_in_the_log(tmp_path: Path) -> None:
    """Whoever looks for the evening's recording finds there why it ended; the robot goes on."""
    disk = FailingDisk()

    async def main() -> None:
        made = settings(tmp_path, auto_start=True)
        async with simulated_robot(made, start_writer=on_disk(disk)) as robot:
            await robot.client.wait_until_armed()
            disk.error = errno.ENOSPC
            await drive(robot, 4.0)
            assert (await robot.client.get_state()).safety.mode == "armed"

    with capture_logs() as log:
        run_virtual(main())
    told = [line for line in log if line["event"] == "recording has a problem"]
    assert len(told) == 1
    assert told[0]["state"] == "failed"
    assert "the disk is full" in told[0]["reason"]
