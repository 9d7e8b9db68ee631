"""Builds the robot's page and its discovery on the local network."""

from typing import TYPE_CHECKING

from chefbotd.features.feature import Feature
from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.server import RpcServer
from chefbotd.settings import Settings
from chefbotd.transport.tcp import TcpServer

if TYPE_CHECKING:
    from chefbotd.transport.web.server import PageServer
import os
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path

from chefbotd.component import PagePart
from chefbotd.composition.context import Context
from chefbotd.composition.robot import robot_description
from chefbotd.composition.scanners import first_scanner
from chefbotd.snapshot import DaemonState


def page_server(
    settings: Settings,
    rpc: RpcServer,
    guard: Guard,
    metrics: Metrics,
    parts: Sequence[tuple[str, PagePart]] = (),
) -> "PageServer | None":
    """The server of the page. It also accepts the name by which the robot is discovered."""
    if not settings.page.enabled:
        return None
    from chefbotd.transport.web.server import Card, PageServer

    parameters = settings.page
    if settings.discovery.enabled:
        own = f"{settings.discovery.label(settings.robot.name)}.local".lower()
        parameters = parameters.model_copy(update={"allowed_hosts": (*parameters.allowed_hosts, own)})
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


def discovery(settings: Settings, server: TcpServer, page: "PageServer | None") -> list[Feature]:
    """The announcement of the socket and of the page."""
    if not settings.discovery.enabled:
        return []
    from chefbotd.components.discovery.service import discovery

    where = None if page is None else page.address
    encrypted = settings.api.tls_certificate is not None
    return [discovery(settings.discovery, settings.robot.name, server.address, where, encrypted=encrypted)]


def recording(context: Context, state: Callable[[], DaemonState]) -> list[Feature]:
    """The feature that records; ``state`` returns the daemon's state. Its modules are loaded after the first stop."""
    settings = context.settings
    if context.start_writer is None or not settings.recording.enabled:
        return []
    from chefbotd.components.recording.parameters import folder_of
    from chefbotd.components.recording.recorder_thread import Made, recorder_maker
    from chefbotd.components.recording.service import RecordingService, recording

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
    from chefbotd.components.foxglove.service import foxglove

    scanner = first_scanner(settings)
    return [foxglove(context.bus, context.clock, settings.foxglove, settings.robot.name, scanner)]
