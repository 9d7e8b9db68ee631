"""Builds the making of maps from the configuration."""

import os

from chefbotd.component_context import Context
from chefbotd.components.mapping.service import MappingService, mapping
from chefbotd.components.mapping.skill_requests import SKILL, MappingSkillParameters
from chefbotd.components.maps.build import map_folder, versions_kept
from chefbotd.components.maps.service import MapsService
from chefbotd.components.worker.service import WorkerService
from chefbotd.features.feature import Feature


def mapping_of(context: Context[None]) -> Feature:
    """The feature that makes maps, with its skill."""
    feed, stored = context.of("worker", WorkerService), context.of("maps", MapsService)
    settings = context.settings
    parameters = MappingSkillParameters(
        lidars=settings.mapping.lidars or tuple(lidar.name for lidar in settings.lidar),
        folder=map_folder(context),
        versions_kept=versions_kept(context),
        session=os.urandom(8).hex(),
        mapping=settings.mapping,
    )
    feed.worker.add_own_skill(SKILL, parameters.model_dump_json().encode())
    service = MappingService(context.bus, context.clock, feed, stored.use_saved)
    stored.growing = service.grid
    return mapping(service)
