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


def page_server(settings: Settings, rpc: RpcServer, guard: Guard, metrics: Metrics) -> "PageServer | None":
    """The server of the page. It also accepts the name by which the robot is discovered."""
    if not settings.page.enabled:
        return None
    from chefbotd.transport.web.server import PageServer

    parameters = settings.page
    if settings.discovery.enabled:
        own = f"{settings.discovery.label(settings.robot.name)}.local".lower()
        parameters = parameters.model_copy(update={"allowed_hosts": (*parameters.allowed_hosts, own)})
    return PageServer(rpc, parameters, guard, metrics)


def discovery(settings: Settings, server: TcpServer, page: "PageServer | None") -> list[Feature]:
    """The announcement of the socket and of the page."""
    if not settings.discovery.enabled:
        return []
    from chefbotd.features.discovery.service import discovery

    where = None if page is None else page.address
    encrypted = settings.api.tls_certificate is not None
    return [discovery(settings.discovery, settings.robot.name, server.address, where, encrypted=encrypted)]
