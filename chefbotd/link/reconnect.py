"""Keeps the link open: reopens a port that went away as soon as it is back."""

import asyncio
import random
from collections.abc import Awaitable, Callable, Iterator
from typing import TYPE_CHECKING

import structlog

from chefbotd.clock import Clock
from chefbotd.core.events.inputs import BOARD_LINK, PortNotOpened, PortShared, TimerFired
from chefbotd.inputs import inputs_of
from chefbotd.link.entry_session import EntrySession, LinkSession, health_timer
from chefbotd.link.port import LinkParameters
from chefbotd.logs import RateLimitedLog

if TYPE_CHECKING:
    from chefbotd.link.cannot_open import Sharers

log = structlog.get_logger(component="link")

Opener = Callable[[LinkParameters, asyncio.BaseProtocol], Awaitable[asyncio.Transport]]
"""Opens a port for a protocol, or raises ``OSError``: ``port.open_port``, or a test's own."""

REMIND_EVERY_S = 60.0
"""How often the log mentions a device that stays away."""

LISTEN_EVERY_S = 0.25

LOOK_EVERY_S, MANY_REFUSED = 5.0, 5
"""So often, and where so many lines were refused meanwhile, it is looked up who else has the port open."""

FindSharers = Callable[[str], "Sharers"]
"""Who else has a device open."""


def find_sharers(device: str) -> "Sharers":
    """As ``cannot_open.sharers_of``, which is loaded where a link is in trouble."""
    from chefbotd.link.cannot_open import sharers_of

    return sharers_of(device)


OPENING_S = 2.0
"""How long the shutdown waits for a port that is being opened, to stop the board behind it."""


def waits_s(parameters: LinkParameters, rng: random.Random) -> Iterator[float]:
    """Seconds between attempts: doubling up to the longest, each varied so that two daemons do not march in step."""
    wait_s = parameters.reconnect_delay_s
    while True:
        yield wait_s * (1 + parameters.reconnect_jitter * rng.uniform(-1, 1))
        wait_s = min(2 * wait_s, parameters.max_reconnect_delay_s)


class PortLink:
    """Owns a port: opens it, waits until it is lost, opens it again. ``name`` is the link's in a recording."""

    def __init__(
        self,
        parameters: LinkParameters,
        session: LinkSession,
        opener: Opener,
        clock: Clock,
        rng: random.Random,
        sharers_of: FindSharers = find_sharers,
        name: str = BOARD_LINK,
    ) -> None:
        self._parameters, self._session, self._opener = parameters, session, opener
        self._name, self._entries = name, inputs_of(clock)
        self._protocol = EntrySession(name, session, clock)
        self._clock, self._rng = clock, rng
        self._waits_s = waits_s(parameters, rng)
        self._log = RateLimitedLog(log)
        self._sharers_of, self._sharers = sharers_of, ""

    async def run(self) -> None:
        """Keep the link open until cancelled; then say the last words (the board's are a stop) and close it."""
        try:
            while True:
                await self._open()
                log.info("link opened", device=self._parameters.device)
                await self._watch_device()
                log.warning("link lost", device=self._parameters.device)
                await self._look_for_sharers()
                await self._back_off()
        finally:
            if self._session.is_open:
                self._session.close()
                await self._session.wait_closed()

    async def _watch_device(self) -> None:
        """Judge until the link is lost whether the right device is connected."""
        closed = asyncio.ensure_future(self._session.wait_closed())
        looked_s, refused = self._clock.now_s(), self._session.refused_lines
        try:
            while not (await asyncio.wait([closed], timeout=LISTEN_EVERY_S))[0]:
                with self._entries.entry(TimerFired, health_timer(self._name)):
                    self._session.judge_health()
                now_s = self._clock.now_s()
                if now_s - looked_s >= LOOK_EVERY_S:
                    if self._sharers or self._session.refused_lines - refused >= MANY_REFUSED:
                        await self._look_for_sharers()
                    looked_s, refused = now_s, self._session.refused_lines
        finally:
            closed.cancel()

    async def _look_for_sharers(self) -> None:
        """Who else has the port open is looked up in a thread: there are many processes."""
        device = self._parameters.device
        seen, suspects = await asyncio.get_running_loop().run_in_executor(None, self._sharers_of, device)
        if seen != self._sharers:
            self._sharers = seen
            with self._entries.entry(PortShared, self._name, seen):
                self._session.report_sharers(seen)
        if seen or suspects:
            self._log.warning("others may read this port", device=device, who=seen or suspects)

    async def _back_off(self) -> None:
        """Only a device that has spoken is opened again soon: a server may accept and close all day."""
        if self._session.is_proven:
            self._waits_s = waits_s(self._parameters, self._rng)
        await asyncio.sleep(next(self._waits_s))

    async def _open(self) -> None:
        complaint, complained_s = "", float("-inf")
        for wait_s in self._waits_s:
            try:
                self._session.expect_connection()
                await self._open_port()
            except OSError as error:
                now_s = self._clock.now_s()
                if str(error) != complaint:
                    words = str(error).removeprefix(f"{self._parameters.device}: ")
                    reason: str = getattr(error, "why", words)
                    with self._entries.entry(PortNotOpened, self._name, reason):
                        self._session.report_not_opened(reason)
                if str(error) != complaint or now_s - complained_s >= REMIND_EVERY_S:
                    complaint, complained_s = str(error), now_s
                    log.warning("link cannot be opened", device=self._parameters.device, error=complaint)
            else:
                return
            await asyncio.sleep(wait_s)

    async def _open_port(self) -> None:
        """Open, and be cancelled only when it is known whether the port is open: it may lead to a robot that moves."""
        opening = asyncio.ensure_future(self._opener(self._parameters, self._protocol))
        try:
            await asyncio.shield(opening)
        except asyncio.CancelledError:
            await asyncio.wait([opening], timeout=OPENING_S)
            opening.cancel()
            raise
