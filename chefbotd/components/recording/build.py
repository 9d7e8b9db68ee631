"""Builds the recorder from the configuration."""

import os
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, TypeAlias

import structlog

from chefbotd.component_context import Context
from chefbotd.components.recording.parameters import RecordingParameters, folder_of
from chefbotd.components.recording.recorder_thread import RecordingHeader, recorder_maker
from chefbotd.components.recording.service import RecordingService, recording
from chefbotd.composition.robot import robot_description
from chefbotd.extras import how_to_add_extra
from chefbotd.features.feature import Feature

log = structlog.get_logger(component="app")

StartWriter: TypeAlias = Callable[[Any, int], Any]
"""Starts the writer of recordings: ``writer.WriterThread``, or a substitute in tests."""

LIBRARIES = {"zstd": "zstandard", "lz4": "lz4"}
"""What each compression of recordings needs."""


def writer_of(parameters: RecordingParameters) -> StartWriter | None:
    """The thread that records; None where the extra ``recording`` is not installed."""
    if not (find_spec("mcap") and find_spec(LIBRARIES[parameters.compression])):
        log.info(f"nothing is recorded, because the extra is missing: {how_to_add_extra('recording')}")
        return None
    from chefbotd.components.recording.writer import WriterThread

    return WriterThread


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
