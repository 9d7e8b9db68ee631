"""The map files that the skill ``mapping`` reads and writes."""

from pathlib import Path
from typing import Protocol

from chefbotd.mapping.occupancy_grid import OccupancyGrid
from chefbotd.mapping.saved import Arrays
from chefbotd.maps import contents
from chefbotd.maps.manifest import GRAPH
from chefbotd.maps.store import MapStore


class MapFiles(Protocol):
    """Each raises ``chefbotd.core.commands.Refused`` where the disk does not do it; what was saved before stays."""

    def save(self, name: str, grid: OccupancyGrid, slam: Arrays) -> int:
        """Save a map with the state to go on from; the number of its version."""
        ...

    def read_slam(self, name: str) -> Arrays | None:
        """The state of a saved map, None where it has none."""
        ...

    def autosave(self, grid: OccupancyGrid, slam: Arrays) -> None:
        """Save the map that is being made."""
        ...

    def has_autosave(self) -> bool:
        """Whether there is a map that was not finished."""
        ...

    def read_autosave(self) -> Arrays | None:
        """Its state, None where there is none."""
        ...

    def autosave_damage(self) -> str:
        """What is wrong with its newest states, in words; empty where nothing is."""
        ...

    def discard_autosave(self) -> None:
        """Forget it."""
        ...


class StoredMaps:
    """The folder of maps."""

    def __init__(self, folder: Path, versions_kept: int) -> None:
        self._store = MapStore(folder, versions_kept)

    def save(self, name: str, grid: OccupancyGrid, slam: Arrays) -> int:
        """Save a map with the state to go on from; the number of its version."""
        return contents.save(self._store, name, grid, slam)

    def read_slam(self, name: str) -> Arrays | None:
        """The state of a saved map, None where it has none."""
        return contents.read_slam(self._store, name)

    def autosave(self, grid: OccupancyGrid, slam: Arrays) -> None:
        """Save the map that is being made."""
        contents.autosave(self._store, grid, slam)

    def has_autosave(self) -> bool:
        """Whether there is a map that was not finished."""
        return self._store.read_autosave() is not None

    def autosave_damage(self) -> str:
        """What is wrong with its newest states, in words; empty where nothing is."""
        _, damage = self._store.look_at_autosave()
        return "; ".join(f"version {number}: {why}" for number, why in damage.items())

    def read_autosave(self) -> Arrays | None:
        """Its state, None where there is none."""
        version = self._store.read_autosave()
        return None if version is None else contents.read_arrays(version.folder / GRAPH)

    def discard_autosave(self) -> None:
        """Forget it."""
        self._store.discard_autosave()
