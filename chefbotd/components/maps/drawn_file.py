"""A file beside a map that clients change: one change after the other, and only of what they have read."""

import asyncio
import hashlib
from collections.abc import Awaitable, Callable, Mapping
from typing import TypeVar

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.maps.service import MapsService
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.store import revision_of
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.inputs import inputs_of

Result = TypeVar("Result")
Places = Mapping[str, tuple[float, float]]


class DrawnFile:
    """``what`` is in it, in the plural, for people: ``zones``. ``keeps_before`` is a file for what was in it before.

    ``changed`` is the event of a change, made of its time, the map and the revision. ``examine`` says what a content
    would do to the robot, to the places of the map in use and to the way there; ``use`` has somebody use what was
    drawn on the map in use, and says why he cannot. Navigation and localization set them, where they are.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        maps: MapsService,
        file: str,
        what: str,
        changed: Callable[[float, str, str], object],
        keeps_before: str | None = None,
    ) -> None:
        self._bus, self._clock, self._entries, self._maps = bus, clock, inputs_of(clock), maps
        self._file, self._what, self._changed, self._before = file, what, changed, keeps_before
        self._order = asyncio.Lock()
        self.examine: Callable[[bytes, Places], Awaitable[tuple[str, ...]]] | None = None
        self.use: Callable[[], Awaitable[str]] | None = None

    async def read(self, name: str) -> bytes | None:
        """Its content; None where there is no file."""
        return await self._maps.read_beside(name, self._file)

    async def read_for_change(self, of_map: str | None, revision: str | None) -> tuple[str, bytes | None]:
        """The map, which is the one in use if none is named, and the content that is to be changed.

        Raises:
            MapStoreError: there is no such map, or the client has read another content than this.
        """
        name = self._maps.named(of_map)
        content = await self.read(name)
        if revision is not None and revision != revision_of(content):
            raise self._changed_meanwhile()
        return name, content

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

    async def require_meant(self, name: str, new: bytes) -> None:
        """Raises ``Refused`` where this content would do something that may not be meant."""
        if self.examine is None or name != self._maps.in_use:
            return
        listed = await self._maps.places(name)
        places = {place.name: (place.x_m, place.y_m) for place in listed.places}
        if concerns := await self.examine(new, places):
            raise Refused(RefusalKind.NEEDS_CONFIRMATION, join_sentences(concerns))

    async def save_change(
        self,
        name: str,
        content: bytes | None,
        new: bytes,
        *,
        keeps_before: bool = True,
        is_visible: bool = True,
    ) -> tuple[str, str | None]:
        """Replace what was there if it is still that, tell of it, and have it used, unless nothing of it is visible.

        Returns the revision, and why it cannot be used, if it cannot: it is saved in any case.

        Raises:
            MapStoreError: something else is there now, or the disk does not take it.
        """
        await self._replace(name, content, new, keeps_before)
        revision = revision_of(new)
        self._entries.observe(self._bus, self._changed(self._clock.now_s(), name, revision))
        return revision, await self._why_unused(name) if is_visible else None

    async def _replace(self, name: str, content: bytes | None, new: bytes, keeps_before: bool) -> None:
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

    async def _why_unused(self, name: str) -> str | None:
        if self.use is None or name != self._maps.in_use:
            return None
        try:
            return await self.use() or None
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


def make_id(*drawn: str) -> str:
    """An id for what is drawn, the same whenever the same is done again."""
    return hashlib.sha256(" ".join(drawn).encode()).hexdigest()[:8]
