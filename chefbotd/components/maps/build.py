"""Builds the store of maps from the configuration."""

import os
from pathlib import Path
from typing import Any

from chefbotd.component_context import Context
from chefbotd.components.maps.service import MapsService, maps
from chefbotd.components.maps.storage.parameters import MapsParameters, folder_of
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.features.feature import Feature


def stored(context: Context[Any]) -> MapsParameters:
    """How maps are stored: as configured, or by default."""
    section = getattr(context.settings, "maps", None)
    return section if isinstance(section, MapsParameters) else MapsParameters()


def map_folder(context: Context[Any]) -> Path:
    """Where the robot's maps are; those of a simulated one are elsewhere."""
    return folder_of(stored(context), os.environ, simulated=context.parts.context.simulated)


def maps_of(context: Context[MapsParameters | None], *, makes_maps: bool) -> Feature:
    """The feature of stored maps."""
    kept = stored(context).versions_kept
    worker = context.settings.of("worker", WorkerParameters)
    most_mb = worker.max_memory_mb if makes_maps else None
    store = MapStore(map_folder(context), kept)
    return maps(MapsService(context.bus, context.clock, store, kept, most_mb))
