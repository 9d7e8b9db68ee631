"""Announces the robot on the local network while the daemon runs, and withdraws it at the end."""

import asyncio
import ipaddress
from collections.abc import Awaitable, Callable
from typing import Protocol

import ifaddr
import structlog
from zeroconf import InterfaceChoice, NonUniqueNameException
from zeroconf.asyncio import AsyncServiceInfo, AsyncZeroconf

from chefbotd import __version__
from chefbotd.client.announcement import SERVICE_TYPE, Announcement
from chefbotd.components.discovery.parameters import DiscoveryParameters
from chefbotd.features.feature import Feature, Service
from chefbotd.rpc.parameters import is_loopback

Interfaces = list[str] | InterfaceChoice

CONFLICT_S = 3.0
"""How long to ask for a robot that has the name already: one that has just said its records waits a second before it
repeats them (RFC 6762, 6), which the library's own three probes, over after 0.35 s, do not wait for."""


class Multicast:
    """``interfaces`` are the addresses of the network interfaces to speak on; all of them by default.

    ``conflict_s`` is how long another robot of the same name may take to answer.
    """

    def __init__(
        self, interfaces: Interfaces = InterfaceChoice.All, *, conflict_s: float = CONFLICT_S
    ) -> None:
        self._interfaces, self._conflict_s = interfaces, conflict_s
        self._zeroconf: AsyncZeroconf | None = None

    async def announce(self, announcement: Announcement) -> None:
        """Claim the name, and answer queries for it.

        Raises:
            NameTaken: another robot has it.
            OSError: there is no network.
        """
        if self._zeroconf is None:
            self._zeroconf = AsyncZeroconf(interfaces=self._interfaces)
        addresses = announcement.addresses or own_addresses()
        other = AsyncServiceInfo(SERVICE_TYPE, announcement.instance)
        if await other.async_request(self._zeroconf.zeroconf, self._conflict_s * 1000):
            raise NameTaken(announcement.name)
        info = AsyncServiceInfo(
            SERVICE_TYPE,
            announcement.instance,
            parsed_addresses=list(addresses),
            port=announcement.port or 0,
            properties=announcement.properties(),
            server=announcement.host,
        )
        try:
            await (await self._zeroconf.async_register_service(info))
        except NonUniqueNameException as error:
            raise NameTaken(announcement.name) from error

    async def withdraw(self) -> None:
        """Say goodbye, and close the sockets."""
        if self._zeroconf is not None:
            await self._zeroconf.async_unregister_all_services()
            await self._zeroconf.async_close()
            self._zeroconf = None


def own_addresses() -> tuple[str, ...]:
    """This computer's IPv4 addresses, without loopback.

    Raises:
        OSError: it has none, because there is no network yet.
    """
    ips = [ip.ip for adapter in ifaddr.get_adapters() for ip in adapter.ips if ip.is_IPv4]
    addresses = tuple([str(ip) for ip in ips if not str(ip).startswith("127.")])
    if not addresses:
        raise OSError("this computer has no address on a network")
    return addresses


log = structlog.get_logger(component="discovery")

AGAIN_S = 60.0
"""The wait after a name conflict, or without a network."""

Listening = Callable[[], Awaitable[tuple[str, int]]]
"""Waits until a server listens: its address."""


class NameTaken(Exception):
    """Another robot on the network has this name."""


class Network(Protocol):
    """Multicast DNS, or a test's substitute."""

    async def announce(self, announcement: Announcement) -> None:
        """Announce the robot if no other one has its name; raises ``NameTaken`` or ``OSError``."""
        ...

    async def withdraw(self) -> None:
        """Withdraw the announcement, if there was one."""
        ...


class DiscoveryService:
    """``label`` is the name on the network, ``robot`` the robot's name; ``page`` is None if no page is served."""

    def __init__(
        self,
        label: str,
        robot: str,
        server: Listening,
        page: Listening | None,
        network: Network,
        *,
        encrypted: bool,
    ) -> None:
        self._label, self._robot, self._encrypted = label, robot, encrypted
        self._server, self._page, self._network = server, page, network

    async def run(self) -> None:
        """Announce the robot until cancelled, unless only its own computer can reach it."""
        server = await self._server()
        page = None if self._page is None else await self._page()
        reachable = [host for host, _ in (server, page or server) if not is_loopback(host)]
        if not reachable:
            log.warning(
                "the robot is not announced: only this computer reaches its sockets",
                hint="set api.host or page.host, with tokens: docs/service.md",
            )
            await asyncio.Event().wait()
        announcement = Announcement(
            self._label,
            tuple([host for host in dict.fromkeys(reachable) if not _is_any(host)]),
            _port(server),
            None if page is None else _port(page),
            self._robot,
            __version__,
            self._encrypted,
        )
        try:
            await self._announce(announcement)
        finally:
            await self._network.withdraw()

    async def _announce(self, announcement: Announcement) -> None:
        """Try until it is announced, then wait for the end."""
        while True:
            try:
                await self._network.announce(announcement)
            except NameTaken:
                log.warning(
                    "the robot is not announced: another one on the network has its name",
                    name=announcement.name,
                    hint="give this one another: [discovery] name",
                )
            except OSError as error:
                log.warning("the robot cannot be announced", error=str(error))
            else:
                log.info("announced", name=announcement.name, port=announcement.port)
                await asyncio.Event().wait()
            await asyncio.sleep(AGAIN_S)


def _port(address: tuple[str, int]) -> int | None:
    """The port, if other computers can reach it."""
    host, port = address
    return None if is_loopback(host) else port


def _is_any(host: str) -> bool:
    """Whether this host means every address of the computer."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def discovery(
    parameters: DiscoveryParameters, robot: str, server: Listening, page: Listening | None, *, encrypted: bool
) -> Feature:
    """The feature that announces the robot on the local network."""
    from chefbotd.components.discovery.service import Multicast  # an optional library

    service = DiscoveryService(parameters.label(robot), robot, server, page, Multicast(), encrypted=encrypted)
    return Feature("discovery", services=(Service("discovery", service.run),))
