"""Maps and places without asyncio: same names, plain calls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.client.client import Client
from chefbotd.client.map_methods import MapImage
from chefbotd.client.wire import ProgressListener

if TYPE_CHECKING:
    from chefbotd.client import models

T = TypeVar("T")


class SyncMaps(ABC):
    """Every method is ``Client``'s of the same name; ``on_progress`` is called in another thread."""

    _client: Client

    @abstractmethod
    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of a coroutine, which runs on the client's loop."""

    def list_maps(self) -> models.MapList:
        """Every stored map, and the one in use."""
        return self._run(self._client.list_maps())

    def load_map(self, name: str, on_progress: ProgressListener | None = None) -> models.MapInUse:
        """Use a map from now on, and after a restart of the daemon."""
        return self._run(self._client.load_map(name, on_progress))

    def get_map(self, name: str | None = None, on_progress: ProgressListener | None = None) -> MapImage:
        """The cells of a map; without a ``name`` of the one that is being made, or else of the one in use."""
        return self._run(self._client.get_map(name, on_progress))

    def import_map(
        self,
        yaml: str,
        name: str | None = None,
        *,
        replace: bool = False,
        on_progress: ProgressListener | None = None,
    ) -> models.MapInUse:
        """Store the map of map_server's files: ``yaml`` is a path on the robot's computer."""
        return self._run(self._client.import_map(yaml, name, replace=replace, on_progress=on_progress))

    def rename_map(self, name: str, new_name: str) -> None:
        """Give a map another name."""
        self._run(self._client.rename_map(name, new_name))

    def delete_map(self, name: str) -> None:
        """Remove a map with all its versions and places."""
        self._run(self._client.delete_map(name))

    def save_place(
        self,
        name: str,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_rad: float | None = None,
        *,
        of_map: str | None = None,
    ) -> models.PlaceData:
        """Give a pose a name, or move the place of this name; without a pose, it is where the robot is."""
        return self._run(self._client.save_place(name, x_m, y_m, heading_rad, of_map=of_map))

    def list_places(self, of_map: str | None = None) -> models.PlaceList:
        """The places of a map; without one, of the map in use."""
        return self._run(self._client.list_places(of_map))

    def delete_place(self, name: str, of_map: str | None = None) -> None:
        """Remove a place."""
        self._run(self._client.delete_place(name, of_map))
