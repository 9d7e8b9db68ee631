"""Builds the making of maps from the configuration."""

import os

from chefbotd.component_context import Context
from chefbotd.components.mapping.algorithms.parameters import MappingParameters
from chefbotd.components.mapping.service import MappingService, mapping
from chefbotd.components.mapping.skill_requests import SKILL, MappingSkillParameters
from chefbotd.components.maps.build import map_folder, stored
from chefbotd.components.maps.service import MapsService
from chefbotd.components.worker.service import WorkerService
from chefbotd.features.feature import Feature


def mapping_of(context: Context[MappingParameters]) -> Feature:
    """The feature that makes maps, with its skill."""
    worker_service, maps = context.of("worker", WorkerService), context.of("maps", MapsService)
    settings = context.settings
    parameters = MappingSkillParameters(
        lidars=context.section.lidars or tuple(lidar.name for lidar in settings.lidar),
        folder=map_folder(context),
        versions_kept=stored(context).versions_kept,
        session=os.urandom(8).hex(),
        mapping=context.section,
    )
    worker_service.worker.add_own_skill(SKILL, parameters.model_dump_json().encode())
    service = MappingService(context.bus, context.clock, worker_service, maps.use_saved)
    maps.growing = service.grid
    return mapping(service)
