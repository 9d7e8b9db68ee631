"""Lines are added to a token file, whoever else adds one."""

import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from chefbotd import storage
from chefbotd.cli.common.exits import ProgramError
from chefbotd.components.invitations import token_file
from tests.waiting import PATIENCE_S

BEFORE, FIRST, SECOND = (
    f"{role} {letter * 64}" for role, letter in zip(("observe", "admin", "drive"), "oad", strict=True)
)


def add_two_at_once(monkeypatch: pytest.MonkeyPatch, first: Path, second: Path) -> None:
    """Begin to add the second line when the first call has read the file; go on when the second waits or is done."""
    waits_or_done = threading.Event()
    read: Callable[[Path, int], bytes] = token_file.read_file

    def add_second() -> None:
        token_file.add_line(second, SECOND)
        waits_or_done.set()

    thread = threading.Thread(target=add_second)

    def read_and_pause(path: Path, most_bytes: int) -> bytes:
        content = read(path, most_bytes)
        if threading.current_thread() is not thread:
            thread.start()
            assert waits_or_done.wait(PATIENCE_S)
        return content

    clock = SimpleNamespace(monotonic=lambda: 0.0, sleep=lambda _: waits_or_done.set())
    monkeypatch.setattr(storage, "time", clock)
    monkeypatch.setattr(token_file, "read_file", read_and_pause)
    token_file.add_line(first, FIRST)
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


@pytest.mark.realtime
@pytest.mark.parametrize("by_link", [False, True])
def test_of_two_lines_that_are_added_at_once_none_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by_link: bool
) -> None:
    """The second waits until the first is written, also where it calls the file by a link in another folder."""
    path, link = tmp_path / "tokens", tmp_path / "etc" / "tokens"
    path.write_text(f"{BEFORE}\n")
    link.parent.mkdir()
    link.symlink_to(path)
    add_two_at_once(monkeypatch, path, link if by_link else path)
    assert path.read_text() == f"{BEFORE}\n{FIRST}\n{SECOND}\n"
    assert link.is_symlink()


def test_a_file_that_stays_locked_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After half a minute nothing is written, and the message says why."""
    clock_s = iter(range(0, 10_000, 10))
    clock = SimpleNamespace(monotonic=lambda: next(clock_s), sleep=lambda _: None)
    monkeypatch.setattr(storage, "time", clock)
    path = tmp_path / "tokens"
    with (
        storage.lock(tmp_path),
        pytest.raises(ProgramError, match="tokens: another program has locked it for too long"),
    ):
        token_file.add_line(path, FIRST)
    assert not path.exists()
