"""Recordings of strangers: a recorded state can name nothing but what the running daemon has registered."""

import asyncio
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame
import msgspec
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk

from chefbotd.core.events.inputs import LimitsExchanged, StateRecorded, TimerFired
from chefbotd.recording.chunk import MAGIC
from chefbotd.recording.classes import decode, encode
from chefbotd.recording.reader import MAX_CHUNK_BYTES, RecordingReader
from chefbotd.replay.build import replayed_daemon
from chefbotd.replay.entries import ReplayEntries
from chefbotd.replay.recorded import MAX_EVENT_BYTES, NotReplayable, Recorded, decoded
from chefbotd.replay.run import settings_of
from chefbotd.settings import load, packaged
from chefbotd.snapshot.restore import Restore
from tests.chefbotd.replay.recordings import replayed

State = dict[str, Any]
DRIVING = "driving 1"


def recorded_state(robot: str = "chefbot") -> State:
    """What a daemon remembers that has done nothing yet, as it is read from a file."""

    async def made() -> bytes:
        return encode(replayed_daemon(load(packaged(robot)), None, ReplayEntries()).state.record())

    found: StateRecorded = decode(StateRecorded, asyncio.run(made()))
    assert found.left_out == ()
    return found.parts


def put_back(state: State) -> list[str]:
    """What is wrong with a state, for a daemon that begins in it."""

    async def put() -> list[str]:
        daemon = replayed_daemon(load(), None, entries := ReplayEntries())
        restore = Restore(entries, daemon.state.restorable)
        restore.put(state, daemon.state.parts)
        assert not entries.timers
        return restore.problems

    return asyncio.run(put())


def forge(state: State, attribute: str, value: Any) -> None:
    """Give the drive service another attribute, or its wheels' controller where that has it."""
    service = state[DRIVING]["is"]
    wheels = service["wheels"]["is"]
    (wheels if attribute in wheels else service)[attribute] = value


def deep(value: Any, levels: int) -> Any:
    """A list in a list in a list."""
    for _ in range(levels):
        value = {"$": "list", "is": [value]}
    return value


def timer(state: State, calls: str, owner: Any = None) -> State:
    """A timer that calls a method of the drive service, or of another part."""
    same = {"$": "same", "as": state[DRIVING]["no"]}
    return {"$": "timer", "waits": True, "name": "odd", "due_s": 1.0, "owner": owner or same, "calls": calls}


def of(cls: str, kind: str = "object", **fields: Any) -> State:
    """An object or a value of a class, by its name."""
    return {"$": kind, "of": cls, "no": 900, "is": fields}


DISK = "chefbotd.recording.disk:Disk"
FORGERIES: dict[str, tuple[str, Callable[[State], Any], str]] = {
    "another class of ours": ("_when_at_rest", lambda state: of(DISK), "Disk"),
    "another program": (
        "_when_at_rest",
        lambda state: of("subprocess:Popen", args="true"),
        "subprocess:Popen",
    ),
    "a module to import": (
        "_when_at_rest",
        lambda state: of("chefbotd.cli.tune.plots:Panel", "value"),
        "plots",
    ),
    "a class as a value": ("_when_at_rest", lambda state: {"$": "class", "of": DISK}, "Disk"),
    "no name": ("_when_at_rest", lambda state: of(["a"], "model"), "no class"),  # type: ignore[arg-type]
    "a second drive service": (
        "_when_at_rest",
        lambda state: of("chefbotd.features.driving.service:DriveService"),
        "may make no other",
    ),
    "a method": ("_when_at_rest", lambda state: timer(state, "detach"), "detach"),
    "an inner method": ("_when_at_rest", lambda state: timer(state, "__init__"), "__init__"),
    "another part's method": (
        "_when_at_rest",
        lambda state: timer(state, "_watch", of("chefbotd.motion.limits:LimiterState")),
        "a timer calls a part",
    ),
    "code": ("_write_duty", lambda state: 5, "_write_duty"),
    "wiring": ("_bus", lambda state: {"$": "dict", "is": []}, "_bus"),
    "what there is not": ("odd", lambda state: 5, "odd"),
    "the class": (
        "__class__",
        lambda state: {"$": "class", "of": "chefbotd.core.geometry:Pose2D"},
        "__class__",
    ),
    "a text for a number": ("stops", lambda state: "many", "stops cannot be a str"),
    "a flag for a number": ("stops", lambda state: True, "stops cannot be a bool"),
    "a number for a state": ("state", lambda state: 5, "state cannot be a int"),
    "another state": ("state", lambda state: of("chefbotd.motion.pid:PidState", "value"), "state"),
    "a field's type": (
        "_still",
        lambda state: {"$": "tuple", "is": [of("chefbotd.core.geometry:Pose2D", "value", x_m="a")]},
        "x_m cannot be a str",
    ),
    "a list in a list": ("_still", lambda state: deep(1, 500), "deep"),
    "a bare list": ("_still", lambda state: [1, 2], "list"),
    "no kind": ("_still", lambda state: {"is": 5}, "KeyError"),
    "an odd kind": ("_still", lambda state: {"$": "eval", "is": "1"}, "eval"),
    "a huge number": ("stops", lambda state: {"$": "int", "is": "9" * 5000}, "ValueError"),
    "a huge array": (
        "_still",
        lambda state: {"$": "array", "dtype": "<f8", "shape": [10**12], "is": "AAAAAAAAAAA="},
        "ValueError",
    ),
    "an array of objects": (
        "_still",
        lambda state: {"$": "array", "dtype": "O", "shape": [1], "is": "AAAAAAAAAAA="},
        "no numbers",
    ),
    "who is not there": ("_still", lambda state: {"$": "same", "as": 10**9}, "KeyError"),
}


def test_a_state_that_nobody_forged_is_put_back() -> None:
    """The tests below would refuse nothing else."""
    assert put_back(recorded_state()) == []


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_state_names_nothing_but_what_is_registered(forgery: str) -> None:
    """Neither a class, nor a method, nor an attribute, nor a type; the refusal names it, and nothing was imported."""
    attribute, value, told = FORGERIES[forgery]
    state = recorded_state()
    forge(state, attribute, value(state))
    loaded = set(sys.modules)
    (problem,) = put_back(state)
    assert problem.startswith(f"{DRIVING}: ")
    assert told in problem
    assert len(problem) < 400
    assert not {each for each in set(sys.modules) - loaded if each.startswith(("chefbotd", "firmware"))}


def test_the_whole_recording_is_refused_with_the_name() -> None:
    """Nothing is replayed from a state that is none of a daemon's."""
    state = recorded_state()
    forge(state, "_when_at_rest", of(DISK))
    with pytest.raises(NotReplayable, match=r"recording\.disk:Disk"):
        replayed([StateRecorded(1.0, state, (), ()), TimerFired(1.2, "drive watch")], load())


def test_the_refusal_is_what_is_told_however_the_replay_ends() -> None:
    """A part of the drive service is taken away, so that it cannot even end in order, and another one is forged."""
    state = recorded_state()
    state[DRIVING]["is"]["_watch_timer"] = None
    state["leases"] = of(DISK)
    with pytest.raises(NotReplayable, match=r"recording\.disk:Disk"):
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
        decoded(Recorded(1, "StateRecorded", deeply))
    with pytest.raises(NotReplayable, match=f"expected at most {MAX_EVENT_BYTES}"):
        decoded(Recorded(1, "StateRecorded", bytes(MAX_EVENT_BYTES + 1)))


@pytest.mark.parametrize("robot", ["chefbot", "khan", "chefbot_lidar"])
def test_a_daemons_own_state_has_nothing_that_may_not_be_named(robot: str) -> None:
    """What it cannot put back it does not write, and says so."""
    assert "chefbotd" in msgspec.json.encode(recorded_state(robot)).decode()


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
    with pytest.raises(
        NotReplayable, match=r"worker\.naps: unknown key \(got 3\).*the version that recorded it"
    ):
        settings_of(msgspec.json.encode(told).decode())
    with pytest.raises(NotReplayable, match="no JSON"):
        settings_of("{")
