"""Multicast DNS with the library zeroconf."""

import ifaddr
from zeroconf import InterfaceChoice, NonUniqueNameException
from zeroconf.asyncio import AsyncServiceInfo, AsyncZeroconf

from chefbotd.features.discovery.announcement import SERVICE_TYPE, Announcement
from chefbotd.features.discovery.service import NameTaken

Interfaces = list[str] | InterfaceChoice


class Multicast:
    """``interfaces`` are the addresses of the network interfaces to speak on; all of them by default."""

    def __init__(self, interfaces: Interfaces = InterfaceChoice.All) -> None:
        self._interfaces = interfaces
        self._zeroconf: AsyncZeroconf | None = None

    async def announce(self, announcement: Announcement) -> None:
        """Claim the name, and answer for it.

        Raises:
            NameTaken: another one has it.
            OSError: there is no network.
        """
        if self._zeroconf is None:
            self._zeroconf = AsyncZeroconf(interfaces=self._interfaces)
        addresses = announcement.addresses or own_addresses()
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
    """This computer's IPv4 addresses but for loopback.

    Raises:
        OSError: it has none: no network yet.
    """
    ips = [ip.ip for adapter in ifaddr.get_adapters() for ip in adapter.ips if ip.is_IPv4]
    addresses = tuple([str(ip) for ip in ips if not str(ip).startswith("127.")])
    if not addresses:
        raise OSError("this computer has no address on a network")
    return addresses
