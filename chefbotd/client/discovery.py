"""Finds robots on the local network by their announced names. Needs the extra ``discovery``."""

import asyncio
from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager, suppress

from zeroconf import InterfaceChoice, ServiceStateChange, Zeroconf
from zeroconf.asyncio import AsyncServiceBrowser, AsyncServiceInfo, AsyncZeroconf

from chefbotd.client.announcement import SERVICE_TYPE, Announcement, read

LISTEN_S = 5.0
"""A browser asks at once, and again after one and after three seconds; a robot that has just said its records waits a
second before it repeats them (RFC 6762, 5.2 and 6). So this gives every robot two chances, one packet may be lost.
"""
ANSWER_S = 3.0

Interfaces = list[str] | InterfaceChoice


async def robots(
    seconds: float = LISTEN_S,
    interfaces: Interfaces = InterfaceChoice.All,
    expected: Collection[str] = (),
) -> list[Announcement]:
    """Every robot that announces itself within this time, by name; sooner where the ``expected`` ones have answered."""
    async with _network(interfaces) as network:
        questions: dict[str, asyncio.Task[Announcement | None]] = {}
        answered = asyncio.Event()

        def note(zeroconf: Zeroconf, service_type: str, name: str, state_change: ServiceStateChange) -> None:
            if state_change is ServiceStateChange.Removed:
                if name in questions:
                    questions.pop(name).cancel()
            elif name not in questions:
                questions[name] = asyncio.create_task(_ask(network, name, ANSWER_S))
                questions[name].add_done_callback(look)

        def look(question: object = None) -> None:
            answers = [question.result() for question in questions.values() if question.done()]
            if expected and {robot.name for robot in answers if robot} >= set(expected):
                answered.set()

        browser = AsyncServiceBrowser(network.zeroconf, SERVICE_TYPE, handlers=[note])
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(seconds):
                    await answered.wait()
        finally:
            await browser.async_cancel()
        answers = await asyncio.gather(*[questions[name] for name in sorted(questions)])
        return [answer for answer in answers if answer is not None]


async def find(
    name: str, seconds: float = ANSWER_S, interfaces: Interfaces = InterfaceChoice.All
) -> Announcement | None:
    """The robot of this name; None if it does not answer in time."""
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
