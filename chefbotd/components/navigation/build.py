"""Builds navigation from the configuration."""

from pathlib import Path

from chefbotd.component_context import Context
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.map_edits.service import MapEditsService
from chefbotd.components.maps.build import map_folder
from chefbotd.components.maps.service import MapsService
from chefbotd.components.navigation.beside_others import join_localization, join_zones
from chefbotd.components.navigation.commands import navigation
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.service import NavigationService
from chefbotd.components.navigation.skill_requests import SKILL, NavigationSkillParameters
from chefbotd.components.worker.service import WorkerService
from chefbotd.components.zones.service import ZonesService
from chefbotd.composition.scanners import robot_outline
from chefbotd.features.feature import Feature
from chefbotd.safety.outline import Box
from chefbotd.settings import Settings


def navigation_of(context: Context[NavigationSection]) -> list[Feature]:
    """The feature that drives to goals, with its skill; none where the robot has no such source of commands."""
    worker_service, settings = context.of("worker", WorkerService), context.settings
    parameters = navigation_skill_parameters(settings, map_folder(context))
    worker_service.worker.add_own_skill(SKILL, parameters.model_dump_json().encode())
    join_localization(context.bus, worker_service.worker, context.of("localization", LocalizationService))
    join_zones(
        worker_service.worker, context.of("zones", ZonesService), context.of("map_edits", MapEditsService)
    )
    if context.driver is None:
        return []
    stored = context.of("maps", MapsService)
    service = NavigationService(
        context.bus, context.clock, worker_service, context.driver, stored, context.section
    )
    return [navigation(service)]


def navigation_skill_parameters(settings: Settings, folder: Path) -> NavigationSkillParameters:
    """The robot's outline, and its speeds: a wheel keeps a tenth of its speed in reserve for corrections."""
    outline, section = robot_outline(settings), settings.of("navigation", NavigationSection)
    box = outline if isinstance(outline, Box) else None
    speed_m_s = min(section.max_speed_m_s, 0.9 * settings.drive.max_rim_speed_m_s)
    guard = settings.safety.guard
    guards = (guard.scan.stop_distance_m, guard.scan.clearance_m) if guard.enabled else (0.0, 0.0)
    return NavigationSkillParameters(
        folder=folder,
        radius_m=outline.radius_m if box is None else None,
        half_length_m=0.0 if box is None else box.half_length_m,
        half_width_m=0.0 if box is None else box.half_width_m,
        navigation=section.model_copy(update={"max_speed_m_s": speed_m_s}),
        silent_speed_m_s=settings.safety.encoders.silent_speed_m_s,
        limits=settings.limits,
        guard_stop_m=guards[0],
        guard_clearance_m=guards[1],
        cameras=tuple(scanner.name for scanner in settings.further_scanners),
        range_mounts={
            name: (mount.x_m, mount.y_m, mount.heading_rad) for name, mount in settings.range_mounts().items()
        },
    )
