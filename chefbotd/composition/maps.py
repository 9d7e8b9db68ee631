"""Builds the map store, and the features that use it in the worker: mapping, localization, navigation."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from chefbotd.components.maps.storage.parameters import MapsParameters, folder_of
from chefbotd.composition.components import brings_skills
from chefbotd.composition.context import Context
from chefbotd.composition.scanners import robot_outline
from chefbotd.driving.service import DriveService
from chefbotd.features.feature import Feature
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.components.maps.service import MapsService
    from chefbotd.components.navigation.skill_requests import NavigationSkillParameters
    from chefbotd.components.worker.process import Worker
    from chefbotd.components.worker.service import WorkerService
    from chefbotd.driving.inner_driver import InnerDriver

NAVIGATION = "navigation"
"""The source of commands that navigation drives as; a robot without it does not navigate."""


def map_features(
    context: Context, driving: DriveService, leases: ControlLeases
) -> tuple[list[Feature], "Worker | None"]:
    """The features of stored maps; with a lidar also the worker, mapping, localization and navigation."""
    settings = context.settings
    makes_maps = bool(settings.lidar) and settings.worker.enabled
    if settings.maps is None and not makes_maps:
        return _worker_alone(context)
    from chefbotd.components.maps.service import MapsService, maps
    from chefbotd.components.maps.storage.store import MapStore

    parameters = settings.maps or MapsParameters()
    folder, kept = folder_of(parameters, os.environ, simulated=context.simulated), parameters.versions_kept
    most_mb = settings.worker.max_memory_mb if makes_maps else None
    stored = MapsService(context.bus, context.clock, MapStore(folder, kept), kept, most_mb)
    if not makes_maps:
        features, process = _worker_alone(context)
        return [maps(stored), *features], process
    from chefbotd.components.worker.service import WorkerService, worker

    skills = _skills(settings, folder, kept)
    feed = WorkerService(context.bus, context.clock, settings.worker, skills, context.spawn_worker)
    features = [maps(stored), worker(feed)]
    features += _mapping_and_localization(context, feed, stored, driving, leases)
    if NAVIGATION in settings.safety.sources:
        features.append(_navigation(context, feed, stored, driving, leases))
    return features, feed.worker


def _worker_alone(context: Context) -> tuple[list[Feature], "Worker | None"]:
    """The worker of a robot without a lidar, where a stranger's component has a skill for it."""
    settings = context.settings
    if not (settings.worker.enabled and brings_skills(context)):
        return [], None
    from chefbotd.components.worker.service import WorkerService, worker

    feed = WorkerService(context.bus, context.clock, settings.worker, {}, context.spawn_worker)
    return [worker(feed)], feed.worker


def _driver(context: Context, driving: DriveService, leases: ControlLeases) -> "InnerDriver":
    from chefbotd.driving.inner_driver import InnerDriver

    return InnerDriver(driving, leases, context.clock, NAVIGATION, context.settings.safety.above(NAVIGATION))


def _mapping_and_localization(
    context: Context,
    feed: "WorkerService",
    stored: "MapsService",
    driving: DriveService,
    leases: ControlLeases,
) -> list[Feature]:
    from chefbotd.components.localization.service import LocalizationService, localization
    from chefbotd.components.mapping.service import MappingService, mapping
    from chefbotd.components.navigation.beside_localization import join_localization

    drives = NAVIGATION in context.settings.safety.sources
    finder = LocalizationService(
        context.bus,
        context.clock,
        feed,
        _driver(context, driving, leases) if drives else None,
        turns_at_start=context.settings.localization.turn_at_start,
    )
    join_localization(context.bus, feed.worker, finder)
    made = MappingService(context.bus, context.clock, feed, stored.use_saved)
    stored.growing, stored.made_ready = made.grid, finder.made_ready
    return [mapping(made), localization(finder)]


def _navigation(
    context: Context,
    feed: "WorkerService",
    stored: "MapsService",
    driving: DriveService,
    leases: ControlLeases,
) -> Feature:
    from chefbotd.components.navigation.commands import navigation
    from chefbotd.components.navigation.service import NavigationService

    driver = _driver(context, driving, leases)
    parameters = context.settings.navigation
    return navigation(NavigationService(context.bus, context.clock, feed, driver, stored, parameters))


def _skills(settings: Settings, folder: Path, versions_kept: int) -> dict[str, bytes]:
    """The start message of each of the worker's skills, by the skill's name."""
    from chefbotd.components.localization import skill_requests as localization_requests
    from chefbotd.components.mapping import skill_requests as mapping_requests
    from chefbotd.components.navigation import skill_requests as navigation_requests

    every = tuple(lidar.name for lidar in settings.lidar)
    mapping = mapping_requests.MappingSkillParameters(
        lidars=settings.mapping.lidars or every,
        folder=folder,
        versions_kept=versions_kept,
        session=os.urandom(8).hex(),
        mapping=settings.mapping,
    )
    localization = localization_requests.LocalizationSkillParameters(
        lidars=settings.localization.lidars or every,
        folder=folder,
        localization=settings.localization,
    )
    return {
        mapping_requests.SKILL: mapping.model_dump_json().encode(),
        localization_requests.SKILL: localization.model_dump_json().encode(),
        navigation_requests.SKILL: navigation_skill_parameters(settings, folder).model_dump_json().encode(),
    }


def navigation_skill_parameters(settings: Settings, folder: Path) -> "NavigationSkillParameters":
    """The robot's outline, and its speeds: a wheel keeps a tenth of its speed in reserve for corrections."""
    from chefbotd.components.navigation.skill_requests import NavigationSkillParameters
    from chefbotd.safety.outline import Box

    outline = robot_outline(settings)
    box = outline if isinstance(outline, Box) else None
    speed_m_s = min(settings.navigation.max_speed_m_s, 0.9 * settings.drive.max_rim_speed_m_s)
    guard = settings.safety.guard
    guards = (guard.scan.stop_distance_m, guard.scan.clearance_m) if guard.enabled else (0.0, 0.0)
    return NavigationSkillParameters(
        folder=folder,
        radius_m=outline.radius_m if box is None else None,
        half_length_m=0.0 if box is None else box.half_length_m,
        half_width_m=0.0 if box is None else box.half_width_m,
        navigation=settings.navigation.model_copy(update={"max_speed_m_s": speed_m_s}),
        silent_speed_m_s=settings.safety.encoders.silent_speed_m_s,
        guard_stop_m=guards[0],
        guard_clearance_m=guards[1],
        cameras=tuple(camera.name for camera in settings.depth_camera),
        range_mounts={
            name: (mount.x_m, mount.y_m, mount.heading_rad) for name, mount in settings.range_mounts().items()
        },
    )
