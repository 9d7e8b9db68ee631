"""Saves the pose from one run to the next in a small file that is replaced at once; errors never raise."""

from pathlib import Path
from typing import Protocol

from chefbotd.localization.saved import NotASavedPose, SavedPose, from_text, to_text
from chefbotd.maps.disk import TEMPORARY, Disk

LARGEST_BYTES = 10_000


class PoseFile(Protocol):
    """What keeps a pose."""

    def read(self) -> SavedPose | None:
        """What was kept; None where there is nothing that can be used."""
        ...

    def write(self, pose: SavedPose) -> str:
        """Keep it; what went wrong, empty if nothing did."""
        ...


class PoseOnDisk:
    """A file; a damaged one is as good as none."""

    def __init__(self, path: Path, disk: Disk | None = None) -> None:
        self._path, self._disk = path, disk or Disk()

    def read(self) -> SavedPose | None:
        """What was kept."""
        try:
            with self._path.open(encoding="utf-8") as file:
                return from_text(file.read(LARGEST_BYTES))
        except (OSError, UnicodeDecodeError, NotASavedPose):
            return None

    def write(self, pose: SavedPose) -> str:
        """Keep it: the old one is there until the new one is on the disk."""
        temporary = self._path.with_name(TEMPORARY + self._path.name)
        try:
            self._disk.make_folder(self._path.parent)
            self._disk.write(temporary, to_text(pose).encode())
            self._disk.rename(temporary, self._path)
        except OSError as error:
            return f"the pose cannot be saved: {error}"
        return ""
