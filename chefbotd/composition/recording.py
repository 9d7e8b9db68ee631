"""Builds the features that see every event: recording to disk, and Foxglove."""

import os
from collections.abc import Callable
from functools import partial

from chefbotd.composition.context import Context
from chefbotd.composition.robot import robot_description
from chefbotd.composition.scanners import first_scanner
from chefbotd.features.feature import Feature
from chefbotd.snapshot import DaemonState


def recording(context: Context, state: Callable[[], DaemonState]) -> list[Feature]:
    """The feature that records; ``state`` returns the daemon's state. Its modules are loaded after the first stop."""
    settings = context.settings
    if context.start_writer is None or not settings.recording.enabled:
        return []
    from chefbotd.features.recording.making import Made, recorder_maker
    from chefbotd.features.recording.service import RecordingService, recording
    from chefbotd.recording.parameters import folder_of

    parameters = settings.recording
    folder = folder_of(parameters, os.environ, simulated=context.simulated)
    made = Made(
        settings.robot.name,
        context.session,
        lambda: settings.model_dump_json(by_alias=True),
        lambda: robot_description(settings)(),
        first_scanner(settings),
    )
    make = recorder_maker(parameters, folder, made, context.clock.now_s())
    start_writer = partial(context.start_writer, make, round(parameters.queue_mb * 1e6))
    service = RecordingService(context.bus, context.clock, parameters, folder, start_writer, state)
    return [recording(service)]


def foxglove(context: Context) -> list[Feature]:
    """A server for Foxglove."""
    settings = context.settings
    if not settings.foxglove.enabled:
        return []
    from chefbotd.features.foxglove.service import foxglove

    scanner = first_scanner(settings)
    return [foxglove(context.bus, context.clock, settings.foxglove, settings.robot.name, scanner)]
