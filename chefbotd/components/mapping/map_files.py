"""The map files that the skill ``mapping`` reads and writes, and the states that it starts from."""

from pathlib import Path
from typing import Final, Protocol

import numpy as np

from chefbotd.components.mapping.algorithms.saved import Arrays, NotASavedState, restore_state, save_state
from chefbotd.components.mapping.algorithms.state import SlamState, start, start_new_part
from chefbotd.components.maps.storage import contents
from chefbotd.components.maps.storage.manifest import GRAPH
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence


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


SESSION: Final = "daemon_session"
"""Under this key an autosave says in which run of the daemon it was made: only there odometry has gone on."""

UNREADABLE: Final = "there was an unfinished map, and nothing of it can be read"


class StartState(Record, frozen=True):
    """A state of SLAM, and what of it is lost (empty: nothing)."""

    state: SlamState
    warning: str = ""


class StartStates:
    """Reads them from ``files``; ``session`` is the daemon's run."""

    def __init__(self, files: MapFiles, session: str) -> None:
        self._files, self._session = files, session

    def asked_for(self, name: str | None, *, unfinished: bool) -> StartState:
        """The unfinished map, the saved map of this name, or an empty one.

        Raises:
            Refused: there is no such map, it cannot be read, or an unfinished one would be lost.
        """
        arrays = self._files.read_autosave()
        if arrays is not None and not unfinished:
            raise Refused(
                RefusalKind.ALREADY_MAPPING,
                Sentence("mapping.unfinished", "there is an unfinished map: go on with it, or discard it"),
            )
        warning = self.warning(is_found=arrays is not None)
        if unfinished and arrays is None:
            if warning:
                raise Refused(RefusalKind.MAP_UNREADABLE, warning)
            raise Refused(
                RefusalKind.NOT_MAPPING, Sentence("mapping.no_unfinished", "there is no unfinished map")
            )
        if name is not None and not unfinished:
            arrays = self._files.read_slam(name)
            if arrays is None:
                raise Refused(
                    RefusalKind.MAP_UNREADABLE,
                    Sentence(
                        "mapping.not_extendable",
                        "the map {map!r} cannot be extended: it was not made by mapping, or its graph is missing",
                        map=name,
                    ),
                )
        return StartState(start() if arrays is None else self._continued(arrays), warning)

    def unfinished(self) -> StartState | None:
        """The unfinished map, if there is one; raises ``Refused`` where it makes no sense."""
        arrays = self._files.read_autosave()
        return None if arrays is None else StartState(self._continued(arrays), self.warning(is_found=True))

    def warning(self, *, is_found: bool) -> str:
        """What is lost of an unfinished map; ``is_found``: an older state of it is whole."""
        damage = self._files.autosave_damage()
        if not damage:
            return ""
        if is_found:
            return Sentence(
                "mapping.older_state",
                "the newest state of it is damaged ({damage}): an older one is used",
                damage=damage,
            )
        return Sentence("mapping.unreadable_state", "{what} ({damage})", what=UNREADABLE, damage=damage)

    def to_keep(self, state: SlamState) -> Arrays:
        """An unfinished map as it is saved."""
        return save_state(state) | {SESSION: np.array(self._session)}

    def _continued(self, arrays: Arrays) -> SlamState:
        """A saved state; where odometry has not gone on since, the robot may be anywhere in it."""
        same_run = SESSION in arrays and str(arrays[SESSION]) == self._session
        try:
            state = restore_state(arrays)
        except NotASavedState as problem:
            raise Refused(
                RefusalKind.MAP_UNREADABLE,
                Sentence("mapping.not_extendable_because", "this map cannot be extended: {why}", why=problem),
            ) from problem
        return state if same_run or not len(state.nodes) else start_new_part(state)
