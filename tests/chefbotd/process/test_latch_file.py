"""The gate's memory in a file."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from chefbotd.process.latch_file import LatchFile, path_of
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import GateState, Mode
from chefbotd.safety.latch import UNCLEAN_SHUTDOWN, UNREADABLE, LatchParameters

ARMED = GateState()
ESTOPPED = GateState(Mode.ESTOPPED, "smoke")
STALLED = GateState(Mode.DISARMED, "left_wheel stalled", fault=FaultKind.WHEEL_STALLED)


@pytest.mark.parametrize(
    ("states", "in_order", "found"),
    [
        ((), True, ARMED),
        ((ARMED,), True, ARMED),
        ((ARMED,), False, UNCLEAN_SHUTDOWN),
        ((ARMED, ESTOPPED), True, ESTOPPED),
        ((ARMED, ESTOPPED), False, ESTOPPED),
        ((ARMED, STALLED), True, STALLED),
        ((ARMED, STALLED), False, STALLED),
        ((ARMED, STALLED, ESTOPPED, ARMED), True, ARMED),
        ((ARMED, STALLED, ESTOPPED, ARMED), False, UNCLEAN_SHUTDOWN),
    ],
)
def test_what_the_next_daemon_finds(
    tmp_path: Path, states: tuple[GateState, ...], in_order: bool, found: GateState
):
    """The last state, if it was a latch; armed after an end in order, or where nothing ever was."""
    path = tmp_path / "made on the way" / "latch.json"
    latch = LatchFile(path)
    for state in states:
        latch.keep(state)
    if in_order:
        latch.end()
    assert LatchFile(path).recall() == found
    assert not path.parent.exists() or {left.name for left in path.parent.iterdir()} <= {path.name}


def test_what_is_no_file_begins_disarmed_and_at_once(tmp_path: Path):
    """A FIFO that nobody writes to holds nothing up; nor does a folder of that name."""
    os.mkfifo(tmp_path / "fifo.json")
    (tmp_path / "folder.json").mkdir()
    with capture_logs():
        assert LatchFile(tmp_path / "fifo.json").recall() == UNREADABLE
        assert LatchFile(tmp_path / "folder.json").recall() == UNREADABLE


def test_who_never_began_takes_no_word_back(tmp_path: Path):
    """A daemon that ends before its first step, as one whose socket is taken does, leaves the file as it found it."""
    path = tmp_path / "latch.json"
    LatchFile(path).keep(ARMED)
    failed = LatchFile(path)
    failed.recall()
    failed.end()
    assert LatchFile(path).recall() == UNCLEAN_SHUTDOWN


def test_without_a_path_nothing_is_remembered():
    """Every start is armed."""
    latch = LatchFile(None)
    latch.keep(ESTOPPED)
    latch.end()
    assert LatchFile(None).recall() == ARMED


def test_the_latch_is_told_when_it_is_found(tmp_path: Path):
    """The log says why a robot that has just started does not move."""
    LatchFile(tmp_path / "latch").keep(ESTOPPED)
    with capture_logs() as logged:
        LatchFile(tmp_path / "latch").recall()
    assert [(entry["event"], entry["mode"], entry["reason"]) for entry in logged] == [
        ("starting in the state in which the last daemon ended", "estopped", "smoke")
    ]


def nonsense(path: Path) -> None:
    """A file that no daemon wrote."""
    path.write_bytes(b"\xff" * 100_000)


def empty(path: Path) -> None:
    """What a power cut may leave."""
    path.touch()


@pytest.mark.parametrize("spoil", [nonsense, empty, Path.mkdir])
def test_what_cannot_be_read_begins_disarmed(tmp_path: Path, spoil: Callable[[Path], None]):
    """Nonsense, nothing, or no file at all in its place: disarmed, the log says why, and arming leaves it again."""
    path = tmp_path / "latch"
    spoil(path)
    with capture_logs() as logged:
        assert LatchFile(path).recall() == UNREADABLE
    assert logged[0]["event"] == "the latch file cannot be read: starting disarmed"
    assert logged[0]["path"] == str(path)


def no_folder(path: Path) -> None:
    """A file where the folder should be."""
    path.parent.write_text("")


def not_writable(path: Path) -> None:
    """A folder with a folder where the file would be made."""
    path.with_suffix(".probe").mkdir(parents=True)


def not_a_file(path: Path) -> None:
    """A folder where the file should be."""
    path.mkdir(parents=True)


@pytest.mark.parametrize("forbid", [no_folder, not_a_file])
def test_what_cannot_be_written_breaks_nothing_and_is_told_once(
    tmp_path: Path, forbid: Callable[[Path], None]
):
    """No exception, one warning however often it is tried, and the end is no disaster either."""
    path = tmp_path / "folder" / "latch"
    forbid(path)
    latch = LatchFile(path)
    with capture_logs() as logged:
        for state in (ARMED, ESTOPPED, ARMED):
            latch.keep(state)
        latch.end()
    assert [entry["event"] for entry in logged] == [
        "the latch file cannot be written: a restart may forget an e-stop or a fault"
    ]


def test_what_could_not_be_written_is_tried_again_at_the_next_change(tmp_path: Path):
    """Room that comes back is used."""
    path = tmp_path / "folder" / "latch"
    no_folder(path)
    latch = LatchFile(path)
    latch.keep(ESTOPPED)
    path.parent.unlink()
    latch.keep(ESTOPPED)
    assert LatchFile(path).recall() == ESTOPPED


def test_each_robot_and_its_simulation_have_files_of_their_own(tmp_path: Path):
    """Whatever their names are made of: arming one arms no other."""
    parameters = LatchParameters(folder=tmp_path)
    paths = [
        path_of(parameters, robot, simulated=simulated)
        for robot in ("chefbot", "khan", "../khan", "a/b", "a%2Fb", "Küche 1")
        for simulated in (False, True)
    ]
    assert len(set(paths)) == len(paths)
    assert {path.parent for path in paths if path} == {tmp_path}
    assert path_of(LatchParameters(), "chefbot", simulated=False) is None


def test_where_the_latch_cannot_be_written_the_robot_does_not_arm(tmp_path: Path):
    """It begins disarmed, and says which file it is and why; with room it begins armed, and leaves nothing behind."""
    path = tmp_path / "folder" / "latch.json"
    not_writable(path)
    with capture_logs() as logged:
        state = LatchFile(path).recall()
    assert (state.mode, state.fault) == (Mode.DISARMED, FaultKind.LATCH_UNWRITABLE)
    assert str(path.parent) in state.reason
    assert logged[-1]["event"] == "starting disarmed: the latch file cannot be written"
    other = tmp_path / "other" / "latch.json"
    assert LatchFile(other).recall() == ARMED
    assert list(other.parent.iterdir()) == []


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
def test_a_disk_that_becomes_full_forgets_no_estop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
):
    """No other file can be made any more: the state is written into the old one, and nothing is left beside it."""
    path = tmp_path / "latch.json"
    latch = LatchFile(path)
    assert latch.keep(ARMED) == ""

    def full(self: Path, data: bytes) -> int:
        self.touch()
        raise OSError(code, os.strerror(code), str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert latch.keep(ESTOPPED) == ""
    monkeypatch.undo()
    assert LatchFile(path).recall() == ESTOPPED
    assert [left.name for left in tmp_path.iterdir()] == ["latch.json"]
