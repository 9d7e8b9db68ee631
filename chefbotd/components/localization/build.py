"""Builds localization from the configuration, and has it find the way by the edits of a map once they are changed."""

from typing import Final

from chefbotd.component_context import Context
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.parameters import LocalizationSection
from chefbotd.components.localization.service import LocalizationService, localization
from chefbotd.components.localization.skill_requests import SKILL, LocalizationSkillParameters, UseEdits
from chefbotd.components.map_edits.service import MapEditsService
from chefbotd.components.maps.build import map_folder
from chefbotd.components.maps.service import MapsService
from chefbotd.components.worker.process import Worker
from chefbotd.components.worker.service import WorkerService
from chefbotd.features.feature import Feature

TURNS_AS = "navigation"
"""The source of commands that a robot turns as to find itself."""

EDITS_TIMEOUT_S: Final = 60.0
"""For each step of making a large map ready again."""


def localization_of(context: Context[LocalizationSection]) -> Feature:
    """The feature that localizes, with its skill."""
    worker_service, stored = context.of("worker", WorkerService), context.of("maps", MapsService)
    settings = context.settings
    parameters = LocalizationSkillParameters(
        lidars=context.section.lidars or tuple(lidar.name for lidar in settings.lidar),
        folder=map_folder(context),
        localization=context.section,
    )
    worker_service.worker.add_own_skill(SKILL, parameters.model_dump_json().encode())
    join_map_edits(worker_service.worker, context.of("map_edits", MapEditsService))
    service = LocalizationService(
        context.bus,
        context.clock,
        worker_service,
        context.parts.drive_as(TURNS_AS),
        turns_at_start=context.section.turn_at_start,
    )
    stored.made_ready = service.made_ready
    return localization(service)


def join_map_edits(worker: Worker, edits: MapEditsService) -> None:
    """Have the worker read the edits of the map in use again."""

    async def use() -> str:
        await worker.request(
            SKILL, UseEdits(), LocalizationChanged, deadline_s=EDITS_TIMEOUT_S, is_replayed=False
        )
        return ""

    edits.file.use = use
