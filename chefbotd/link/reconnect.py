"""Keeping the link open: a port that goes away is opened again as soon as it is back."""

import asyncio
import random
from collections.abc import Awaitable, Callable, Iterator

import structlog

from chefbotd.clock import Clock
from chefbotd.link.port import LinkParameters
from chefbotd.link.session import BoardSession

log = structlog.get_logger(component="link")

Opener = Callable[[LinkParameters, asyncio.BaseProtocol], Awaitable[asyncio.Transport]]
"""Opens a port for a protocol, or raises ``OSError``: ``port.open_port``, or a test's own."""

REMIND_EVERY_S = 60.0
"""A device that stays away is mentioned in the log this often, however often it is tried."""

LISTEN_EVERY_S = 0.25

OPENING_S = 2.0
"""How long the end waits for a port that is being opened, so that the board behind it is told to stop."""


def waits_s(parameters: LinkParameters, rng: random.Random) -> Iterator[float]:
    """Seconds between attempts: doubling up to the longest, each varied so that two daemons do not march in step."""
    wait_s = parameters.reconnect_first_s
    while True:
        yield wait_s * (1 + parameters.reconnect_jitter * rng.uniform(-1, 1))
        wait_s = min(2 * wait_s, parameters.reconnect_longest_s)


class BoardLink:
    """Owns the port: opens it, waits until it is lost, opens it again."""

    def __init__(
        self,
        parameters: LinkParameters,
        session: BoardSession,
        opener: Opener,
        clock: Clock,
        rng: random.Random,
    ) -> None:
        self._parameters, self._session, self._opener = parameters, session, opener
        self._clock, self._rng = clock, rng
        self._waits_s = waits_s(parameters, rng)

    async def run(self) -> None:
        """Keep the link open until cancelled; then stop the motors and close it."""
        try:
            while True:
                await self._open()
                log.info("link opened", device=self._parameters.device)
                await self._watch()
                log.warning("link lost", device=self._parameters.device)
                await self._back_off()
        finally:
            if self._session.is_open:
                self._session.close()
                await self._session.wait_closed()

    async def _watch(self) -> None:
        """Until the link is lost: hear whether it is the board that talks."""
        closed = asyncio.ensure_future(self._session.wait_closed())
        try:
            while not (await asyncio.wait([closed], timeout=LISTEN_EVERY_S))[0]:
                self._session.judge_health()
        finally:
            closed.cancel()

    async def _back_off(self) -> None:
        """Only a board that has spoken is opened again soon: a server may accept and close all day."""
        if self._session.hearing.proven:
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
                    self._session.report_not_opened(str(error).removeprefix(f"{self._parameters.device}: "))
                if str(error) != complaint or now_s - complained_s >= REMIND_EVERY_S:
                    complaint, complained_s = str(error), now_s
                    log.warning("link cannot be opened", device=self._parameters.device, error=complaint)
            else:
                return
            await asyncio.sleep(wait_s)

    async def _open_port(self) -> None:
        """Open, and be cancelled only when it is known whether the port is open: it may lead to a robot that moves."""
        opening = asyncio.ensure_future(self._opener(self._parameters, self._session))
        try:
            await asyncio.shield(opening)
        except asyncio.CancelledError:
            await asyncio.wait([opening], timeout=OPENING_S)
            opening.cancel()
            raise
