"""``chefbotd replay``: files that are whole, cut off, damaged, and none at all."""

import asyncio
import json
import struct
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from mcap.writer import Writer

from chefbotd import __version__
from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotd import main
from chefbotd.components.recording.replay import recorded
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import recorded_file
from tests.chefbotd.components.recording.replay.test_replay import drive
from tests.robot_files import full


async def short(robot: SimulatedRobot) -> None:
    """An arc, an e-stop."""
    await asyncio.sleep(0.8)
    await drive(robot, 0.21, 0.37, 1.1)
    await robot.client.estop("a test")
    await asyncio.sleep(0.3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A recording of two seconds, in chunks of 0.2 s."""
    folder = tmp_path_factory.mktemp("recording")
    return recorded_file(short, load(), folder, chunk_s=0.2).read_bytes()


def replay(data: bytes, folder: Path, *options: str | Path) -> Result:
    """Replay these bytes."""
    path = folder / "drive.mcap"
    path.write_bytes(data)
    return CliRunner().invoke(main, ["replay", str(path), *[str(each) for each in options]])


def seconds_of(result: Result) -> float:
    """How much was replayed."""
    return float(json.loads(result.stdout)["seconds"])


def test_a_file_is_replayed_bit_for_bit(whole: bytes, tmp_path: Path) -> None:
    """What the disk has is what was on the bus."""
    result = replay(whole, tmp_path)
    assert result.exit_code == Exit.OK, result.output
    assert "2.3 s of chefbot" in result.output
    assert "events are the same, bit for bit." in result.output
    assert "Note" not in result.output


def test_another_configuration_shows_what_it_would_have_done(whole: bytes, tmp_path: Path) -> None:
    """Another gain changes duties and nothing that was measured; the first difference has both values."""
    other = tmp_path / "other.toml"
    text = full("chefbot").read_text()
    assert "kp_duty_per_m_s = 200.0" in text
    other.write_text(text.replace("kp_duty_per_m_s = 200.0", "kp_duty_per_m_s = 290.0"))
    result = replay(whole, tmp_path, "--config", other)
    assert result.exit_code == Exit.OK, result.output
    assert "The first difference: at 1000.8" in result.output  # the robot is driven from 1000.8 s on
    told = json.loads(replay(whole, tmp_path, "--config", other, "--json").stdout)
    driven, measured = told["events"]["WheelsDriven"], told["events"]["WheelsMeasured"]
    assert (measured["differing"], driven["recorded"]) == (0, driven["replayed"])
    assert driven["differing"] > 5
    assert driven["field"].startswith("duty[")
    assert told["first_difference"]["recorded"] != told["first_difference"]["replayed"]


def test_the_same_configuration_from_a_file_differs_nowhere(whole: bytes, tmp_path: Path) -> None:
    """What is told of another configuration is that configuration's doing."""
    result = replay(whole, tmp_path, "--config", "chefbot")
    assert "events are the same, bit for bit." in result.output


def test_a_configuration_for_another_board_is_refused(whole: bytes, tmp_path: Path) -> None:
    """The bytes of one wire mean nothing on another."""
    result = replay(whole, tmp_path, "--config", "khan")
    assert result.exit_code == Exit.FAILED
    assert "'khan" in result.output
    assert "'classic'" in result.output


@pytest.mark.parametrize("share", [0.4, 0.73])
def test_a_file_that_was_cut_off_is_replayed_up_to_there(whole: bytes, share: float, tmp_path: Path) -> None:
    """As after a kill: every event up to the last whole chunk is the same, and that it was cut is told."""
    cut = whole[: int(len(whole) * share)]
    result = replay(cut, tmp_path, "--json")
    assert result.exit_code == Exit.OK, result.output
    told = json.loads(result.stdout)
    assert told["exact"]
    assert told["problem"].startswith(
        "drive.mcap: its end is missing: it is still being recorded, its writer was killed"
    )
    assert 0.3 < told["seconds"] < 2.3
    assert "replayed up to there" in replay(cut, tmp_path).output


def in_a_chunk(data: bytes) -> int:
    """A place within a chunk's compressed messages, in the second half of the file."""
    at = 8
    while True:
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == 6 and at > len(data) // 2:
            return at + 9 + int(length) - 20
        at += 9 + length


def test_a_damaged_chunk_ends_the_replay(whole: bytes, tmp_path: Path) -> None:
    """A byte that has changed on the disk is noticed, and nothing behind it is believed."""
    damaged = bytearray(whole)
    damaged[in_a_chunk(whole)] ^= 0x55
    told = json.loads(replay(bytes(damaged), tmp_path, "--json").stdout)
    assert told["exact"]
    assert "damaged" in told["problem"]
    assert told["seconds"] < 2.0


@pytest.mark.parametrize(
    ("data", "expected"),
    [(b"", "is empty"), (b"t\t1\t2\n", "is not an MCAP file"), (b"\x89MCAP0\r\n", "no configuration")],
    ids=["empty", "text", "cut"],
)
def test_what_is_no_recording_is_refused(data: bytes, expected: str, tmp_path: Path) -> None:
    """The message names the file and what is wrong with it."""
    result = replay(data, tmp_path)
    told = result.output
    assert result.exit_code == Exit.FAILED
    assert expected in told
    assert "drive.mcap" in told


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    """So is a folder, also one without a name: a script's variable that is empty is the folder of the moment."""
    for path in (tmp_path / "nothing.mcap", tmp_path, Path(), Path("/")):
        result = CliRunner().invoke(main, ["replay", str(path)])
        assert result.exit_code == Exit.FAILED
        assert str(path) in result.output


def test_somebody_elses_mcap_file_has_no_configuration(tmp_path: Path) -> None:
    """It is not replayed with whatever configuration there is."""
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    result = CliRunner().invoke(main, ["replay", str(tmp_path / "drive.mcap")])
    assert result.exit_code == Exit.FAILED
    assert "no configuration" in result.output


def test_what_another_version_recorded_is_replayed_only_when_asked_for(
    whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version may do other things with the same input; both versions are named."""
    recorded_by = __version__
    monkeypatch.setattr(recorded, "__version__", "99.1")
    result = replay(whole, tmp_path)
    assert result.exit_code == Exit.FAILED
    assert f"recorded by chefbotd {recorded_by}, and this is 99.1" in result.output
    assert replay(whole, tmp_path, "--any-version").exit_code == Exit.OK


def test_a_recording_in_parts_is_replayed_whole(tmp_path: Path) -> None:
    """The first file brings those that go on from it."""
    path = recorded_file(short, load(), tmp_path, chunk_s=0.1, rotate_minutes=0.01)
    assert len(list(tmp_path.glob("*_part*.mcap"))) > 1
    told = json.loads(CliRunner().invoke(main, ["replay", str(path), "--json"]).stdout)
    assert told["exact"], told
    assert told["seconds"] > 2.0


def test_two_recordings_are_not_taken_for_one(whole: bytes, tmp_path: Path) -> None:
    """As by ``auto_*.mcap``: the second would be left out without a word, also where it is not there at all."""
    other = tmp_path / "other.mcap"
    result = replay(whole, tmp_path, other)
    assert result.exit_code == Exit.FAILED
    assert f"{other} cannot be read" in result.output
    (tmp_path / "later").mkdir()
    recorded_file(short, load(), tmp_path / "later").rename(other)
    result = replay(whole, tmp_path, other)
    assert result.exit_code == Exit.FAILED
    assert f"{other}: is of another recording than {tmp_path / 'drive.mcap'}" in " ".join(
        result.output.split()
    )


def test_a_recording_that_began_later_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    """It has what the robot knew before; that it does not begin with the daemon is told."""

    async def script(robot: SimulatedRobot) -> None:
        await asyncio.sleep(1.3)
        await drive(robot, 0.1, 0.2, 0.4)
        await robot.client.start_recording("later")
        await drive(robot, 0.2, -0.2, 0.8)
        await robot.client.stop_recording()

    path = recorded_file(script, load(), tmp_path, auto_start=False)
    result = CliRunner().invoke(main, ["replay", str(path)])
    assert "it begins from the state that was recorded" in result.output
    assert "events are the same, bit for bit." in result.output
    assert result.exit_code == Exit.OK


def test_the_ring_is_replayed_from_its_first_state(tmp_path: Path) -> None:
    """The last minutes begin anywhere; what comes before the first state is told, the rest is the same."""

    async def script(robot: SimulatedRobot) -> None:
        await asyncio.sleep(13.3)
        await drive(robot, 0.1, 0.2, 9.4)
        await robot.client.estop("a test")
        await robot.client.save_ring("odd")

    recorded_file(script, load(), tmp_path, auto_start=False, ring_s=12.0)
    result = CliRunner().invoke(main, ["replay", str(next(tmp_path.glob("ring_*.mcap")))])
    assert "it begins from the state that was recorded" in result.output
    assert "events are the same, bit for bit." in result.output
    assert result.exit_code == Exit.OK


def test_listen_needs_serve(tmp_path: Path) -> None:
    """An address without a socket is a mistake."""
    result = replay(b"", tmp_path, "--listen", "127.0.0.1:7000")
    assert result.exit_code == Exit.USAGE
