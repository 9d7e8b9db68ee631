"""Naming who has a device."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from chefbotd.link.owner import UNKNOWN, owner_of

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
