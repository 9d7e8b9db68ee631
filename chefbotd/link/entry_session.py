"""Between a port and its session: makes every action of the port an entry from outside."""

import asyncio
from typing import Protocol

from chefbotd.clock import Clock
from chefbotd.core.events.inputs import (
    LinkBytesRead,
    PortDrained,
    PortLost,
    PortNotOpened,
    PortOpened,
    PortShared,
    TimerFired,
)
from chefbotd.inputs import inputs_of
from chefbotd.link.reconnect import LinkSession


class PortSession(LinkSession, Protocol):
    """A session that is an ``asyncio.Protocol`` too."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio's."""

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio's."""

    def data_received(self, data: bytes) -> None:
        """As asyncio's."""

    def resume_writing(self) -> None:
        """As asyncio's."""


class EntrySession(asyncio.Protocol):
    """Stands for ``session`` towards the port and ``PortLink``; ``link`` is its name in a recording."""

    def __init__(self, link: str, session: PortSession, clock: Clock) -> None:
        self._link, self._session, self._entries = link, session, inputs_of(clock)
        self._entries.links[link] = session

    # What asyncio tells us

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A port was opened."""
        with self._entries.entry(PortOpened, self._link):
            self._session.connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """The port is gone."""
        with self._entries.entry(PortLost, self._link, str(exc) if exc else None):
            self._session.connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes have come in: the busiest way into the process, so it does by hand what ``entry`` does."""
        entries = self._entries
        outermost = entries.begin()
        try:
            if entries.recording:
                entries.publish(LinkBytesRead(entries.now_s(), self._link, bytes(data)))
            self._session.data_received(data)
        finally:
            if outermost:
                entries.end()

    def resume_writing(self) -> None:
        """The transport has drained."""
        with self._entries.entry(PortDrained, self._link):
            self._session.resume_writing()

    # What the link asks

    @property
    def is_open(self) -> bool:
        """Whether a port is connected."""
        return self._session.is_open

    @property
    def is_proven(self) -> bool:
        """Whether the right device has been heard since the port was opened."""
        return self._session.is_proven

    def expect_connection(self) -> None:
        """A port is about to be opened: ``wait_closed`` is to wait for its end."""
        self._session.expect_connection()

    async def wait_closed(self) -> None:
        """Wait until the expected connection has come and gone."""
        await self._session.wait_closed()

    def judge_health(self) -> None:
        """Look at what has come in lately."""
        with self._entries.entry(TimerFired, health_timer(self._link)):
            self._session.judge_health()

    def report_not_opened(self, reason: str) -> None:
        """The port cannot be opened."""
        with self._entries.entry(PortNotOpened, self._link, reason):
            self._session.report_not_opened(reason)

    @property
    def refused_lines(self) -> int:
        """How many lines, or packets, were refused so far."""
        return self._session.refused_lines

    def report_sharers(self, sharers: str) -> None:
        """Who else has the port open."""
        with self._entries.entry(PortShared, self._link, sharers):
            self._session.report_sharers(sharers)

    def close(self) -> None:
        """Say the last words, and give the port up."""
        self._session.close()


def health_timer(link: str) -> str:
    """What the regular look at a link is called in a recording."""
    return f"{link} health"
