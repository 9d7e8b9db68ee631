"""Finds robots on the local network by their announced names. Needs the extra ``discovery``."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from zeroconf import InterfaceChoice, ServiceStateChange, Zeroconf
from zeroconf.asyncio import AsyncServiceBrowser, AsyncServiceInfo, AsyncZeroconf

from chefbotd.features.discovery.announcement import SERVICE_TYPE, Announcement, read

LISTEN_S = 2.0
ANSWER_S = 3.0

Interfaces = list[str] | InterfaceChoice


async def robots(
    seconds: float = LISTEN_S, interfaces: Interfaces = InterfaceChoice.All
) -> list[Announcement]:
    """Every robot that announces itself within this time, by name."""
    async with _network(interfaces) as network:
        names: set[str] = set()

        def noted(zeroconf: Zeroconf, service_type: str, name: str, state_change: ServiceStateChange) -> None:
            if state_change is ServiceStateChange.Removed:
                names.discard(name)
            else:
                names.add(name)

        browser = AsyncServiceBrowser(network.zeroconf, SERVICE_TYPE, handlers=[noted])
        try:
            await asyncio.sleep(seconds)
        finally:
            await browser.async_cancel()
        found = await asyncio.gather(*[_ask(network, name, ANSWER_S) for name in sorted(names)])
        return [each for each in found if each is not None]


async def find(
    name: str, seconds: float = ANSWER_S, interfaces: Interfaces = InterfaceChoice.All
) -> Announcement | None:
    """The robot of this name, None where nobody answers to it in time."""
    async with _network(interfaces) as network:
        return await _ask(network, f"{name}.{SERVICE_TYPE}", seconds)


async def _ask(network: AsyncZeroconf, instance: str, seconds: float) -> Announcement | None:
    info = AsyncServiceInfo(SERVICE_TYPE, instance)
    if not await info.async_request(network.zeroconf, seconds * 1000):
        return None
    return read(instance, tuple(info.parsed_addresses()), info.port, info.properties)


@asynccontextmanager
async def _network(interfaces: Interfaces) -> AsyncIterator[AsyncZeroconf]:
    network = AsyncZeroconf(interfaces=interfaces)
    try:
        yield network
    finally:
        await network.async_close()
