"""Builds the recorder from the configuration."""

import os
from functools import partial

from chefbotd.component_context import Context
from chefbotd.components.recording.parameters import RecordingParameters, folder_of
from chefbotd.components.recording.recorder_thread import RecordingHeader, recorder_maker
from chefbotd.components.recording.service import RecordingService, recording
from chefbotd.composition.context import StartWriter
from chefbotd.composition.robot import robot_description
from chefbotd.features.feature import Feature


def recorder_of(context: Context[RecordingParameters], start: StartWriter) -> Feature:
    """The feature that records the daemon's events and its state."""
    parameters, settings, daemon = context.section, context.settings, context.parts.context
    folder = folder_of(parameters, os.environ, simulated=daemon.simulated)
    header = RecordingHeader(
        settings.robot.name,
        daemon.session,
        lambda: settings.model_dump_json(by_alias=True),
        lambda: robot_description(settings)(),
        settings.first_scanner,
    )
    make = recorder_maker(parameters, folder, header, context.clock.now_s())
    start_writer = partial(start, make, round(parameters.queue_mb * 1e6))
    service = RecordingService(
        context.bus, context.clock, parameters, folder, start_writer, context.parts.state
    )
    return recording(service)
