"""Why a port cannot be opened, who has it, and what to do about it."""

import errno
import fcntl
import grp
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from chefbotd.link.cannot_open import UNKNOWN, Sharers, advice, owner_of, sharers_of

ABSENT = OSError(errno.ENOENT, "No such file or directory")
DENIED = OSError(errno.EACCES, "Permission denied")


def plug(monkeypatch: pytest.MonkeyPatch, *devices: Path | str) -> None:
    """Let these be the computer's serial ports."""
    ports = [SimpleNamespace(device=str(device)) for device in devices]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)


def test_an_absent_device_is_told_with_the_ports_that_are_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Those that have a lasting name by that, in order."""
    by_id, board, other = tmp_path / "by-id", tmp_path / "ttyACM1", tmp_path / "ttyUSB0"
    by_id.mkdir()
    board.touch()
    (by_id / "usb-Texas_Instruments-if00").symlink_to("../ttyACM1")
    plug(monkeypatch, other, board)
    assert advice("/dev/ttyACM0", ABSENT, by_id) == (
        f"there is no such device; available serial ports: {by_id}/usb-Texas_Instruments-if00 ({board}), {other}"
    )


def test_no_port_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Then it is the cable, or the power."""
    plug(monkeypatch)
    told = advice("/dev/ttyACM0", ABSENT, tmp_path / "no-such-folder")
    assert "no serial port was found" in told
    assert "plugged in and powered" in told


@pytest.mark.parametrize(
    ("groups", "told"),
    [
        (
            [4, 24],
            "only members of the group dialout may use it: run 'sudo usermod -aG dialout $USER', then log out",
        ),
        ([4, 20], "does not allow your group dialout to read and write: check its udev rule"),
    ],
)
def test_a_device_of_another_group(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, groups: list[int], told: str
) -> None:
    """Whoever is not in the group is told how to join it; who is, that this is not why."""
    device = tmp_path / "ttyACM0"
    device.touch()
    status = SimpleNamespace(st_gid=20)
    monkeypatch.setattr(Path, "stat", lambda _path: status)
    monkeypatch.setattr(grp, "getgrgid", lambda gid: SimpleNamespace(gr_name={20: "dialout"}[gid]))
    monkeypatch.setattr(os, "getgroups", lambda: groups)
    said = advice(str(device), DENIED)
    assert said.startswith("permission denied; ")
    assert told in said


def test_a_device_that_goes_meanwhile(tmp_path: Path) -> None:
    """Nothing is known of it then; any other error speaks for itself."""
    gone = str(tmp_path / "gone")
    assert advice(gone, DENIED) == "permission denied; is this user allowed to use it?"
    assert advice(gone, OSError("Could not configure port")) == "Could not configure port"


HOLD = """
import fcntl, sys
file = open(sys.argv[1])
if sys.argv[2] == "lock":
    fcntl.flock(file, fcntl.LOCK_EX)
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def device(tmp_path: Path) -> Path:
    """A file that stands for a device."""
    path = tmp_path / "board"
    path.touch()
    return path


@pytest.mark.parametrize("how", ["open", "lock"])
def test_another_process_is_named(device: Path, how: str):
    """Whoever has it open or locked: program and pid, also when asked by a symbolic link."""
    link = device.with_name("link")
    link.symlink_to(device)
    command = [sys.executable, "-c", HOLD, str(device), how]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        program = Path(f"/proc/{other.pid}/comm").read_text().strip()
        assert owner_of(str(link)) == f"{program} (pid {other.pid})"


def test_a_locker_whose_files_we_may_not_see_is_named(device: Path, tmp_path: Path):
    """The list of locks is for everybody: pid 7 is found by it though nothing of the process is to be seen."""
    status = device.stat()
    file = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    proc = tmp_path / "proc"
    (proc / "7").mkdir(parents=True)
    (proc / "locks").write_text(
        f"1: POSIX  ADVISORY  READ 6 00:01:1 0 EOF\n2: FLOCK  ADVISORY  WRITE 7 {file} 0 EOF\n"
    )
    assert owner_of(str(device), proc) == f"{UNKNOWN} (pid 7)"


def test_nobody_to_be_seen_is_an_unknown_process(device: Path):
    """A file that only we have open has no other owner that could be named."""
    with device.open() as ours:
        fcntl.flock(ours, fcntl.LOCK_EX)
        assert owner_of(str(device)) == UNKNOWN


@pytest.mark.parametrize("there", ["board", "another"])
def test_a_file_of_the_same_name_in_another_namespace_is_not_ours(
    device: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: str
):
    """A sandboxed service has a /dev of its own: its descriptor bears our device's name, and leads to another file."""
    (tmp_path / "another").touch()
    proc = tmp_path / "proc"
    (proc / "9" / "fd").mkdir(parents=True)
    (proc / "9" / "comm").write_text("chefbotd\n")
    (proc / "locks").touch()
    (proc / "9" / "fd" / "3").symlink_to(tmp_path / there)
    monkeypatch.setattr(Path, "readlink", lambda _self: device)
    assert owner_of(str(device), proc) == ("chefbotd (pid 9)" if there == "board" else UNKNOWN)


def process(proc: Path, pid: int, name: str, *open_files: Path, parent: int = 1) -> None:
    """A process that /proc tells of."""
    files = proc / str(pid) / "fd"
    files.mkdir(parents=True)
    (proc / str(pid) / "comm").write_text(f"{name}\n")
    (proc / str(pid) / "stat").write_text(f"{pid} ({name}) S {parent} 1 1 0")
    for number, path in enumerate(open_files):
        (files / str(number)).symlink_to(path)


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    """A /proc without locks."""
    folder = tmp_path / "proc"
    folder.mkdir()
    (folder / "locks").write_text("")
    return folder


def test_a_second_program_on_our_port_is_named(proc: Path, tmp_path: Path) -> None:
    """By its name and pid; those that we have started do not count, nor who has other files open."""
    port = tmp_path / "ttyACM0"
    port.touch()
    process(proc, 501, "minicom", port)
    process(proc, 502, "bash", tmp_path / "other")
    process(proc, 503, "python", port, parent=os.getpid())
    assert sharers_of(str(port), proc) == Sharers(
        seen=f"minicom (pid 501) has {port} open too: two readers each get a part of the bytes"
    )


def test_what_is_known_of_a_second_program_is_said(proc: Path, tmp_path: Path) -> None:
    """ModemManager is told off by a udev rule."""
    port = tmp_path / "ttyACM0"
    port.touch()
    process(proc, 501, "ModemManager", port)
    assert "udev rule" in sharers_of(str(port), proc).seen


def test_who_cannot_be_seen_is_a_suspect(proc: Path, tmp_path: Path) -> None:
    """Of another user's process no file is seen: one that opens every port is named as running, not as the reader."""
    port = tmp_path / "ttyACM0"
    port.touch()
    process(proc, 501, "ModemManager")
    process(proc, 502, "bash")
    sharers = sharers_of(str(port), proc)
    assert sharers.seen == ""
    assert sharers.suspects.startswith("ModemManager (pid 501) runs here")


@pytest.mark.parametrize("device", ["/dev/no-such-device", "socket://127.0.0.1:1"])
def test_what_is_no_device_has_no_sharers(proc: Path, device: str) -> None:
    """It may have been unplugged, or be another computer's."""
    process(proc, 501, "ModemManager")
    assert sharers_of(device, proc) == Sharers()
