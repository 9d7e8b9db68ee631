"""A file beside a map that clients change: one change after the other, and only of what they have read."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

from chefbotd.clock import Clock
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import revision_of
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import inputs_of

Result = TypeVar("Result")
Use = Callable[[], Awaitable[str]]
"""Has somebody use what was drawn on the map in use, and says why he cannot."""


class DrawnFile:
    """``what`` is in it, in the plural, for people: ``zones``. ``keeps_before`` is a file for what was in it before."""

    def __init__(
        self, clock: Clock, maps: MapsService, file: str, what: str, keeps_before: str | None = None
    ) -> None:
        self._entries, self._maps = inputs_of(clock), maps
        self._file, self._what, self._before = file, what, keeps_before
        self._order = asyncio.Lock()

    async def read(self, name: str) -> bytes | None:
        """Its content; None where there is no file."""
        return await self._maps.read_beside(name, self._file)

    async def in_order(self, change: Callable[[], Awaitable[Result]]) -> Result:
        """One change after the other; a replay makes none, because the disk and the worker are not there.

        One that has begun is not given up half-way, also where its client goes: what is on the disk is driven by.
        """

        async def change_alone() -> Result:
            async with self._order:
                return await change()

        async def finish() -> Result:
            work = asyncio.ensure_future(change_alone())
            try:
                return await asyncio.shield(work)
            except asyncio.CancelledError:
                await asyncio.wait([work])
                raise

        return await self._entries.outside(finish)

    async def compute_in_thread(self, compute: Callable[[], Result]) -> Result:
        """Read or write its content out of the loop: YAML of many zones takes a second, in which a stop would wait."""
        return await self._entries.outside(lambda: asyncio.to_thread(compute))

    def require_revision(self, content: bytes | None, revision: str | None) -> None:
        """Raises ``MapStoreError`` where a client has read another content than this."""
        if revision is not None and revision != revision_of(content):
            raise self._changed_meanwhile()

    async def replace(
        self, name: str, content: bytes | None, new: bytes, *, keeps_before: bool = True
    ) -> None:
        """Keep what was there, and replace it if it is still that; raises ``MapStoreError``."""
        if await self.read(name) != content:  # edited by hand while navigation was asked
            raise self._changed_meanwhile()

        def kept(_: bytes | None) -> bytes:
            return b"" if content is None else content

        def replaced(now: bytes | None) -> bytes:
            if now != content:
                raise self._changed_meanwhile()
            return new

        if self._before is not None and keeps_before and new != content:
            await self._maps.change_beside(name, self._before, kept)
        await self._maps.change_beside(name, self._file, replaced)

    async def why_unused(self, name: str, use: Use | None) -> str:
        """Have somebody use it, if the map is in use, and say why he cannot; it is saved in any case."""
        if use is None or name != self._maps.in_use:
            return ""
        try:
            return await use()
        except Refused as refused:
            return f"the worker could not be told of the {self._what}, and reads them as the map is loaded: {refused}"

    def _changed_meanwhile(self) -> MapStoreError:
        return MapStoreError(
            RefusalKind.CHANGED_MEANWHILE,
            Sentence(
                "maps.changed_meanwhile",
                "the {what} were changed meanwhile; look at them, and try again",
                what=self._what,
            ),
        )
