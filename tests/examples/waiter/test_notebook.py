"""The waiter's notebook: memory changes after the disk, never before."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from chefbotd.storage import replace_file
from examples.waiter.notebook import CannotNote, Notebook


class FullDisk:
    """Writes, and refuses where ``is_full``."""

    is_full = False

    def write(self, path: Path, content: bytes) -> None:
        """Replace the file, if there is room."""
        if self.is_full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        replace_file(path, content)


CHANGES: dict[str, Callable[[Notebook], object]] = {
    "take": lambda notebook: notebook.take("table 2", 7),
    "note_agreed": lambda notebook: notebook.note_agreed(9),
    "note_way_home": lambda notebook: notebook.note_way_home(is_stopped=True),
    "note": lambda notebook: notebook.note(notebook.page.orders[0], "driving"),
    "note_try": lambda notebook: notebook.note_try(notebook.page.orders[0], is_stopped=True),
    "note_served": lambda notebook: notebook.note_served(notebook.page.orders[0], 8),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_cannot_be_written_is_not_changed_and_can_be_repeated(tmp_path: Path, name: str) -> None:
    """Memory, and what another program reads of the file, stay the same; with room again both change alike."""
    disk, path = FullDisk(), tmp_path / "orders.json"
    notebook = Notebook(path, disk.write)
    notebook.take("table 1", 5)
    before, disk.is_full = notebook.page, True
    with pytest.raises(CannotNote, match="I cannot write to my notebook: the disk is full"):
        CHANGES[name](notebook)
    assert notebook.page == before == Notebook(path).page
    disk.is_full = False
    CHANGES[name](notebook)
    assert notebook.page != before
    assert Notebook(path).page == notebook.page
