"""Builds the robot's page, and its recorder."""

from typing import TYPE_CHECKING

from chefbotd.features.feature import Feature
from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.server import RpcServer
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.transport.web.server import PageServer
import os
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path

from chefbotd.component import PagePart
from chefbotd.composition.components import hosts_of_components
from chefbotd.composition.context import Context
from chefbotd.composition.robot import robot_description
from chefbotd.snapshot import DaemonState


def page_server(
    settings: Settings,
    rpc: RpcServer,
    guard: Guard,
    metrics: Metrics,
    parts: Sequence[tuple[str, PagePart]] = (),
) -> "PageServer | None":
    """The server of the page. It also accepts the names that components say, such as the one on the network."""
    if not settings.page.enabled:
        return None
    from chefbotd.transport.web.server import Card, PageServer

    parameters = settings.page
    hosts = (*parameters.allowed_hosts, *hosts_of_components(settings))
    parameters = parameters.model_copy(update={"allowed_hosts": hosts})
    cards = [
        Card(
            name,
            Path(str(import_module(part.package).__file__)).with_name(part.file),
            part.column,
            part.before,
        )
        for name, part in parts
    ]
    return PageServer(rpc, parameters, guard, metrics, cards)


def recording(context: Context, state: Callable[[], DaemonState]) -> list[Feature]:
    """The feature that records; ``state`` returns the daemon's state. Its modules are loaded after the first stop."""
    settings = context.settings
    if context.start_writer is None or not settings.recording.enabled:
        return []
    from chefbotd.components.recording.parameters import folder_of
    from chefbotd.components.recording.recorder_thread import RecordingHeader, recorder_maker
    from chefbotd.components.recording.service import RecordingService, recording

    parameters = settings.recording
    folder = folder_of(parameters, os.environ, simulated=context.simulated)
    made = RecordingHeader(
        settings.robot.name,
        context.session,
        lambda: settings.model_dump_json(by_alias=True),
        lambda: robot_description(settings)(),
        settings.first_scanner,
    )
    make = recorder_maker(parameters, folder, made, context.clock.now_s())
    start_writer = partial(context.start_writer, make, round(parameters.queue_mb * 1e6))
    service = RecordingService(context.bus, context.clock, parameters, folder, start_writer, state)
    return [recording(service)]
