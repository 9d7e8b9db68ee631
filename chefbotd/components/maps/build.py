"""Builds the store of maps from the configuration."""

import os
from pathlib import Path

from chefbotd.component_context import Context
from chefbotd.components.maps.service import MapsService, maps
from chefbotd.components.maps.storage.parameters import MapsParameters, folder_of
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.features.feature import Feature


def map_folder(context: Context[None]) -> Path:
    """Where the robot's maps are; those of a simulated one are elsewhere."""
    parameters = context.settings.maps or MapsParameters()
    return folder_of(parameters, os.environ, simulated=context.parts.context.simulated)


def versions_kept(context: Context[None]) -> int:
    """How many earlier versions of a map are kept."""
    return (context.settings.maps or MapsParameters()).versions_kept


def maps_of(context: Context[None], *, makes_maps: bool) -> Feature:
    """The feature of stored maps."""
    kept = versions_kept(context)
    most_mb = context.settings.worker.max_memory_mb if makes_maps else None
    store = MapStore(map_folder(context), kept)
    return maps(MapsService(context.bus, context.clock, store, kept, most_mb))
