"""Builds the robot's page."""

from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from chefbotd.component import PagePart
from chefbotd.composition.components import hosts_of_components
from chefbotd.metrics import Metrics
from chefbotd.rpc.access import Guard
from chefbotd.rpc.server import RpcServer
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.transport.web.server import Card, PageServer


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
    from chefbotd.transport.web.server import PageServer

    parameters = settings.page
    hosts = (*parameters.allowed_hosts, *hosts_of_components(settings))
    parameters = parameters.model_copy(update={"allowed_hosts": hosts})
    return PageServer(rpc, parameters, guard, metrics, cards_of(parts))


def cards_of(parts: Iterable[tuple[str, PagePart]]) -> "list[Card]":
    """The cards of these components, each with its component's name."""
    from chefbotd.transport.web.server import Card

    return [
        Card(
            name,
            Path(str(import_module(part.package).__file__)).parent / part.file,
            part.panel,
            part.title,
            part.order,
            part.for_guests,
        )
        for name, part in parts
    ]
