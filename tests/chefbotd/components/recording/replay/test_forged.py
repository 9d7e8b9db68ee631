"""Recordings of strangers: a recorded state is nothing but plain values of the types that the daemon's parts declare."""

import asyncio
import random
import resource
import sys
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import lz4.frame
import msgspec
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk

from chefbotd.components.recording.chunk import MAGIC
from chefbotd.components.recording.reader import MAX_CHUNK_BYTES, RecordingReader
from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.recorded import (
    MAX_EVENT_BYTES,
    NotReplayable,
    Recorded,
    decode_event,
)
from chefbotd.components.recording.replay.run import settings_of
from chefbotd.core.events.inputs import DaemonStarted, LimitsExchanged, StateRecorded, TimerFired, WorkerSaid
from chefbotd.event_classes import decode, encode
from chefbotd.settings import load, packaged
from chefbotd.snapshot import encode_state
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import recorded, replayed

State = dict[str, str]
LOOP, GAINS, LEASES, BOARD, SCANS = "driving/loop", "tuning/gains", "leases", "link/board", "driving/scans"


def recorded_state(robot: str = "chefbot") -> State:
    """What a daemon remembers that has done nothing yet, as it is read from a file."""

    async def made() -> bytes:
        return encode(replayed_daemon(load(packaged(robot)), None, ReplayEntries()).state.record())

    found: StateRecorded = decode(StateRecorded, asyncio.run(made()))
    assert found.left_out == ()
    return found.parts


def put_back(state: Mapping[str, object], robot: str = "chefbot") -> list[str]:
    """What is wrong with a state, for a daemon that begins in it."""

    async def put() -> list[str]:
        daemon = replayed_daemon(load(packaged(robot)), None, entries := ReplayEntries())
        problems = daemon.state.restore(state)
        assert not entries.timers
        return problems

    return asyncio.run(put())


def packed(value: Any) -> str:
    """A part's state as it stands in a recording."""
    return b64encode(msgspec.msgpack.encode(value)).decode()


def opened(state: State, part: str) -> Any:
    """A part's state as plain values."""
    return msgspec.msgpack.decode(b64decode(state[part]))


def forge(state: State, part: str, way: Sequence[str | int], value: Any) -> None:
    """Put a value somewhere into a part's state; without a way, in place of it."""
    forged = whole = opened(state, part)
    for step in way[:-1]:
        forged = forged[step]
    if way:
        forged[way[-1]] = value
    state[part] = packed(whole if way else value)


def deep(levels: int) -> Any:
    """A list in a list in a list."""
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


def deeply(levels: int) -> str:
    """The same, deeper than anything in Python, in place of a state."""
    return b64encode(b"\x91" * levels + b"\x01").decode()


def named(name: str) -> dict[str, Any]:
    """Something that says of which class it is."""
    return {"type": name, "$": "object", "of": name, "is": {}, "__class__": name, "args": "true"}


DISK = "chefbotd.components.recording.folder:Disk"
MORE = "more in it than"
FORGERIES: dict[str, tuple[str, Sequence[str | int], Any, str]] = {
    "another class of ours": (LOOP, ["wheels"], named(DISK), "pids"),
    "another program": (LOOP, ["wheels"], named("subprocess:Popen"), "pids"),
    "a class as a value": (
        LOOP,
        ["stopped_by"],
        named(DISK),
        "Expected `str`, got `object` - at `$.stopped_by`",
    ),
    "a class in place of a part": (LOOP, [], named(DISK), "missing required field"),
    "no name": (LOOP, ["keeper", "memory", "gate", "mode"], "chefbotd", "Invalid enum value 'chefbotd'"),
    "a second drive service": (
        LOOP,
        ["keeper"],
        {"service": named("DriveService")},
        "missing required field",
    ),
    "a method": (LOOP, ["watch_timer", "calls"], "detach", MORE),
    "a method in place of a time": (
        LOOP,
        ["watch_timer", "due_s"],
        "__init__",
        "Expected `float | null`, got `str`",
    ),
    "another part's timer": (LOOP, ["watch_timer", "name"], "navigation progress", MORE),
    "code": (LOOP, ["_write_duty"], 5, MORE),
    "wiring": (LOOP, ["_bus"], {}, MORE),
    "what there is not": (LOOP, ["keeper", "odd"], 5, MORE),
    "the class": (LOOP, ["__class__"], "Pose2D", MORE),
    "a text for a number": (LOOP, ["stops"], "many", "Expected `int`, got `str` - at `$.stops`"),
    "a flag for a number": (LOOP, ["stops"], True, "Expected `int`, got `bool` - at `$.stops`"),
    "a number for a state": (LOOP, ["wheels"], 5, "Expected `object`, got `int` - at `$.wheels`"),
    "another state": (LOOP, ["wheels"], {"integral_duty": 0.0}, "missing required field `pids`"),
    "a field's type": (LOOP, ["wheels", "limiter", "twist", "linear_m_s"], "a", "linear_m_s"),
    "too few": (LOOP, ["wheels", "duty"], 5, "Expected `array`, got `int`"),
    "a list in a list": (LOOP, ["wheels", "duty"], deep(500), "Expected `int`, got `array`"),
    "a list in a list that nobody asked for": (LOOP, ["odd"], deep(500), MORE),
    "a huge number": (LOOP, ["stops"], 1e300, "Expected `int`, got `float`"),
    "a number of its own kind": (
        LOOP,
        ["stops"],
        msgspec.msgpack.Ext(1, b"os.system"),
        "Expected `int`, got `ext`",
    ),
    "gains of no wheel": (GAINS, ["gains"], {}, "KeyError"),
    "gains that are none": (GAINS, ["gains", "left_wheel"], '{"kp": "many"}', "kp"),
    "gains of another class": (GAINS, ["gains", "left_wheel"], '{"__class__": "Disk"}', "__class__"),
    "gains that are no text": (GAINS, ["gains", "left_wheel"], 5, "Expected `str`, got `int`"),
    "who is not there": (LEASES, ["leases"], {"teleop": [10**9, 1.0]}, "KeyError: 1000000000"),
    "the robot's own driver": (LEASES, ["leases"], {"teleop": [-7, 1.0]}, "KeyError: -7"),
    "a message of another class": (BOARD, ["reader", "decoder", 3], {"Disk": 1}, "KeyError: 'Disk'"),
    "no reason of ours": (BOARD, ["reader", "decoder", 4], {"odd": 1}, "Invalid enum value 'odd'"),
}


def test_a_state_that_nobody_forged_is_put_back() -> None:
    """The tests below would refuse nothing else."""
    assert put_back(recorded_state()) == []


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_state_is_nothing_but_what_its_part_declares(forgery: str) -> None:
    """Neither a class, nor a method, nor an attribute, nor a type; the refusal tells it, and nothing was imported."""
    part, way, value, told = FORGERIES[forgery]
    state = recorded_state()
    forge(state, part, way, value)
    loaded = set(sys.modules)
    (problem,) = put_back(state)
    assert problem.startswith(f"{part}: ")
    assert told in problem
    assert len(problem) < 400
    assert not {each for each in set(sys.modules) - loaded if each.startswith(("chefbotd", "firmware"))}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ({"$": "object", "of": DISK, "no": 0, "is": {}}, "an earlier version"),
        (5, "an earlier version"),
        ("no base64!", "Error"),
        ("", "truncated"),
        (deeply(100_000), "Expected `object`, got `array`"),
        (packed({"wheels": 1})[:8], "Error"),
        (b64encode(bytes(5_000_000)).decode(), "Expected `object`, got `int`"),
    ],
)
def test_what_is_no_state_at_all_is_refused(text: object, told: str) -> None:
    """One of an earlier version, no text, no MessagePack, nested without end, cut off, five megabytes of nothing."""
    (problem,) = put_back({**recorded_state(), LOOP: text})
    assert problem.startswith(f"{LOOP}: ")
    assert told in problem


@pytest.mark.parametrize(
    ("points", "told"),
    [
        ([[10**12, 2], bytes(8)], "reshape"),
        ([[-1, 2], bytes(32)], MORE),
        ([[1, 2], b"os.system"], "buffer size"),
        ([[1, 2], "<f8"], "Expected `bytes`, got `str`"),
        ([["O"], bytes(8)], "Expected `int`, got `str`"),
        ("numpy:load", "Expected `array`, got `str`"),
    ],
)
def test_an_array_is_as_many_numbers_as_it_says(points: Any, told: str) -> None:
    """Neither more than there are, nor counted by itself, nor objects."""
    state = recorded_state("chefbot_lidar")
    seen = {"points_m": points, "stamp_s": 1.0, "arrival_s": 1.0, "turn_s": 0.1}
    forge(state, SCANS, ["seen"], {"lidar": [seen]})
    (problem,) = put_back(state, "chefbot_lidar")
    assert told in problem


def test_the_state_of_another_lidar_is_refused() -> None:
    """Its name is one of two that a state may have there."""
    state = recorded_state("chefbot_lidar")
    part = "link/lidar/lidar"
    forge(state, part, ["reader", "type"], "rplidar")
    (problem,) = put_back(state, "chefbot_lidar")
    assert problem.startswith(f"{part}: ")
    forge(state, part, ["reader", "type"], DISK)
    (problem,) = put_back(state, "chefbot_lidar")
    assert f"Invalid value '{DISK}'" in problem


def test_a_part_that_there_is_not_is_told() -> None:
    """By its name, cut short."""
    (problem,) = put_back({**recorded_state(), "x" * 5000: packed(1)})
    assert problem == f"this daemon has no part '{'x' * 100}'"


@pytest.mark.parametrize("robot", ["chefbot", "chefbot_lidar"])
def test_a_damaged_state_is_refused_or_is_one_of_this_daemon(robot: str) -> None:
    """Bytes are changed at random: whatever is put back has the types that its part declares; nothing is imported."""
    state, chance = recorded_state(robot), random.Random(3)

    async def damaged() -> None:
        daemon = replayed_daemon(load(packaged(robot)), None, ReplayEntries())
        loaded, refused = set(sys.modules), 0
        for _ in range(3000):
            part = chance.choice(list(state))
            data = bytearray(b64decode(state[part]))
            for _ in range(chance.choice((1, 1, 3))):
                data[chance.randrange(len(data))] = chance.randrange(256)
            problems = daemon.state.restore({part: b64encode(data).decode()})
            refused += bool(problems)
            assert all(len(problem) < 400 for problem in problems)
            assert problems or not daemon.state.restore(
                {part: encode_state(daemon.state.parts[part].state())}
            )
        assert refused > 1000
        assert not {each for each in set(sys.modules) - loaded if each.startswith(("chefbotd", "firmware"))}

    asyncio.run(damaged())


def test_the_whole_recording_is_refused_with_the_place() -> None:
    """Nothing is replayed from a state that is none of a daemon's."""
    state = recorded_state()
    forge(state, LOOP, ["stopped_by"], named(DISK))
    with pytest.raises(NotReplayable, match=r"driving/loop: .*stopped_by.*--any-version"):
        replayed([StateRecorded(1.0, state, (), ()), TimerFired(1.2, "drive watch")], load())


def test_a_state_of_an_earlier_version_is_refused_and_a_replay_from_the_start_passes_it() -> None:
    """It named classes and attributes; a recording from the daemon's start needs none of it."""
    old = StateRecorded(1.1, {"driving 1": {"$": "object", "of": "a:B", "no": 0, "is": {}}}, (), ())
    timer = TimerFired(1.2, "drive watch")
    with pytest.raises(NotReplayable, match="this daemon has no part 'driving 1'"):
        replayed([old, timer], load())
    outcome = replayed([DaemonStarted(1.0, "armed", "started", None), old, timer], load())
    assert outcome.from_start


def test_the_refusal_is_what_is_told_however_the_replay_ends() -> None:
    """A part that is put back makes an end in order impossible, and another one is forged."""
    state = recorded_state()
    forge(state, LOOP, ["wheels", "duty"], [])
    forge(state, LEASES, ["leases"], {"teleop": [-7, 1.0]})
    with pytest.raises(NotReplayable, match="leases: KeyError: -7"):
        replayed([StateRecorded(1.0, state, (), ()), TimerFired(1.2, "drive watch")], load())


def test_what_cannot_be_handled_is_told_and_no_traceback() -> None:
    """Limits that are none: the entry is named, with what is wrong."""
    events = [StateRecorded(1.0, recorded_state(), ("board",), ()), LimitsExchanged(1.1, {"linear": "fast"})]
    with pytest.raises(NotReplayable, match="LimitsExchanged cannot be replayed: ValidationError"):
        replayed([*events, TimerFired(1.2, "odd")], load())


def test_a_state_is_neither_huge_nor_endlessly_deep() -> None:
    """Both end before anything is made of it."""
    deeply = (
        b'{"stamp_s":1.0,"parts":{"a":'
        + b"[" * 100_000
        + b"]" * 100_000
        + b'},"open_links":[],"left_out":[]}'
    )
    with pytest.raises(NotReplayable, match="StateRecorded"):
        decode_event(Recorded(1, "StateRecorded", deeply))
    with pytest.raises(NotReplayable, match=f"expected at most {MAX_EVENT_BYTES}"):
        decode_event(Recorded(1, "StateRecorded", bytes(MAX_EVENT_BYTES + 1)))


@pytest.mark.parametrize("robot", ["chefbot", "khan", "chefbot_lidar"])
def test_a_daemons_own_state_fits_it_and_has_nothing_of_the_program(robot: str) -> None:
    """No class, module or method is named in it."""
    state = recorded_state(robot)
    assert put_back(state, robot) == []
    assert not any(b"chefbotd" in b64decode(text) or b"__" in b64decode(text) for text in state.values())


@pytest.mark.parametrize(
    ("compression", "size"), [("zstd", 300_000_000), ("lz4", 300_000_000), ("zstd", 90_000)]
)
def test_a_chunk_that_unpacks_to_more_than_it_says_is_no_recording(
    tmp_path: Path, compression: str, size: int
) -> None:
    """A few kilobytes of file that would be hundreds of megabytes of memory: told as damage, and never unpacked."""
    data = bytes(size)
    packed = zstandard.compress(data) if compression == "zstd" else lz4.frame.compress(data, store_size=False)
    says = size if size > MAX_CHUNK_BYTES and compression == "zstd" else 80_000
    chunk = Chunk(compression, packed, 1, 0, 0, says)
    writer = RecordBuilder()
    chunk.write(writer)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MAGIC + writer.end())
    del data
    reader, before = RecordingReader(path), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert list(reader.messages()) == []
    assert "damaged" in str(reader.problem)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # KiB


def test_a_recording_with_keys_of_an_earlier_version_is_replayed_with_todays() -> None:
    """Nobody can change the configuration in a recording: known keys are renamed, another one is told with a way out."""
    told = msgspec.json.decode(load(packaged("chefbot_lidar")).model_dump_json(by_alias=True))
    told["mapping"]["lidar"] = "lidar"
    del told["mapping"]["lidars"]
    told["worker"]["most_memory_mb"] = 777.5
    del told["worker"]["max_memory_mb"]
    deaf = told["safety"]["deaf"] = told["safety"].pop("unresponsive")
    deaf["slack_m"] = 3 * deaf.pop("tolerance_m")
    settings = settings_of(msgspec.json.encode(told).decode())
    assert settings.mapping.lidars == ("lidar",)
    assert settings.worker.max_memory_mb == 777.5
    assert settings.safety.unresponsive.tolerance_m == deaf["slack_m"]
    told["worker"]["naps"] = 3
    with pytest.raises(NotReplayable, match=r"worker\.naps: unknown key.*the version that recorded it"):
        settings_of(msgspec.json.encode(told).decode())
    with pytest.raises(NotReplayable, match="no JSON"):
        settings_of("{")


def test_a_recording_with_keys_that_became_constants_is_replayed_where_they_agree() -> None:
    """The keys of ``[mapping.slam]``, under their newest and their oldest names; another value is told."""
    recorded = msgspec.json.decode(load(packaged("chefbot_lidar")).model_dump_json(by_alias=True))
    matching = {"laser_noise_m": 0.03, "window_at_most_m": 1.0, "max_window_rad": 0.6}
    slam = {"matching": matching, "submaps": {"length_m": 12}, "loops": {"lookups_a_step": 30000000}}
    recorded["mapping"]["slam"] = slam
    settings = settings_of(msgspec.json.encode(recorded).decode())
    assert settings == settings_of(load(packaged("chefbot_lidar")).model_dump_json(by_alias=True))
    matching["laser_noise_m"] = 0.05
    expected = (
        r"mapping\.slam\.matching\.laser_noise_m was 0\.05 then.* always 0\.03; the version that recorded it"
    )
    with pytest.raises(NotReplayable, match=expected):
        settings_of(msgspec.json.encode(recorded).decode())


def test_what_a_worker_said_to_an_older_version_is_refused_in_words() -> None:
    """Its messages had no name of their record: they are not passed over in silence."""
    said = msgspec.msgpack.encode(["told", "mapping", msgspec.msgpack.encode(["status", "idle"])])
    settings = load(packaged("chefbot_lidar"))

    async def script(robot: SimulatedRobot) -> None:
        await asyncio.sleep(0.2)

    events = recorded(script, settings)
    started = [event for event in events if isinstance(event, DaemonStarted)]
    entry = WorkerSaid(started[-1].stamp_s, said)
    with pytest.raises(NotReplayable, match="the version that recorded it replays it"):
        replayed([*started, entry, entry], settings)
