"""What is said to systemd."""

import socket
from pathlib import Path

import pytest
import structlog

from chefbotd.process import keep_alive


def test_without_systemd_nothing_is_said(monkeypatch: pytest.MonkeyPatch):
    """No NOTIFY_SOCKET: nobody listens, and that is no error."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    assert keep_alive.notify("READY=1") is False


@pytest.mark.parametrize("abstract", [False, True])
def test_the_state_arrives_as_one_datagram(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, abstract: bool):
    """A socket in the file system and an abstract one (leading @) both get the text."""
    name = f"@chefbotd-test-{tmp_path.name}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind("\0" + name[1:] if abstract else name)
        monkeypatch.setenv("NOTIFY_SOCKET", name)
        assert keep_alive.notify("READY=1\nSTATUS=listening") is True
        assert listener.recv(100) == b"READY=1\nSTATUS=listening"


def test_a_socket_that_is_not_there_is_no_disaster(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """The daemon runs on, and says in its log what it could not tell."""
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "absent"))
    with structlog.testing.capture_logs() as logged:
        assert keep_alive.notify("READY=1") is False
    assert logged[0]["event"] == "systemd cannot be notified"


@pytest.mark.parametrize(
    ("told", "folder"),
    [(None, None), ("", None), ("/run/chefbotd", "/run/chefbotd"), ("/run/a:/run/b", "/run/a")],
)
def test_the_runtime_folder_is_the_first_one(
    monkeypatch: pytest.MonkeyPatch, told: str | None, folder: str | None
):
    """As keep_alive.exec(5) has it, several are separated by colons; without the variable there is none."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    if told is not None:
        monkeypatch.setenv("RUNTIME_DIRECTORY", told)
    assert keep_alive.runtime_folder() == (None if folder is None else Path(folder))
