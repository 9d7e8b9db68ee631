"""Between a port and its session: makes every action of the port an entry from outside."""

import asyncio
from typing import Protocol

from chefbotd.clock import Clock
from chefbotd.core.events.inputs import LinkBytesRead, PortDrained, PortLost, PortOpened
from chefbotd.inputs import inputs_of


class LinkSession(Protocol):
    """One end of a wire, an ``asyncio.Protocol`` that lives across reconnections: the board's, or a lidar's."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio's."""

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio's."""

    def data_received(self, data: bytes) -> None:
        """As asyncio's."""

    def resume_writing(self) -> None:
        """As asyncio's."""

    @property
    def is_open(self) -> bool:
        """Whether a port is connected."""
        ...

    @property
    def is_proven(self) -> bool:
        """Whether the right device has been heard since the port was opened."""
        ...

    def expect_connection(self) -> None:
        """A port is about to be opened: ``wait_closed`` is to wait for its end."""
        ...

    async def wait_closed(self) -> None:
        """Wait until the expected connection has come and gone."""
        ...

    def judge_health(self) -> None:
        """Look at what has come in lately."""
        ...

    def report_not_opened(self, reason: str) -> None:
        """The port cannot be opened."""
        ...

    @property
    def refused_lines(self) -> int:
        """How many lines, or packets, were refused so far."""
        ...

    def report_sharers(self, sharers: str) -> None:
        """Who else has the port open, for people; empty: nobody any more."""
        ...

    def close(self) -> None:
        """Say the last words, and give the port up."""
        ...


class EntrySession(asyncio.Protocol):
    """Stands for ``session`` towards the port; ``link`` is its name in a recording."""

    def __init__(self, link: str, session: LinkSession, clock: Clock) -> None:
        self._link, self._session, self._entries = link, session, inputs_of(clock)
        self._entries.links[link] = session

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


def health_timer(link: str) -> str:
    """What the regular look at a link is called in a recording."""
    return f"{link} health"
