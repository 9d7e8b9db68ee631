"""Builds the robot's page."""

from typing import TYPE_CHECKING

from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.server import RpcServer
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.transport.web.server import PageServer
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from chefbotd.component import PagePart
from chefbotd.composition.components import hosts_of_components


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
