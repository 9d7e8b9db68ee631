"""The camera while the daemon runs: switched on while somebody looks, started again when it fails."""

import asyncio
import base64
import random
from typing import Final

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.camera.events import CameraChanged, CameraData, CameraPictureTaken
from chefbotd.components.camera.link.source import (
    ArrivedPicture,
    CameraLost,
    OpenSource,
    PictureSource,
    RateLimit,
)
from chefbotd.components.camera.models import CameraFrame
from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import inputs_of

log = structlog.get_logger(component="camera")

LINGER_S: Final = 10.0
"""So long after the last look it is switched off: as long as a client may wait for a picture."""
FIRST_WAIT_S, LONGEST_WAIT_S = 0.5, 5.0
START_S: Final = 20.0
"""What a source may take to its first picture, and to what it says itself of that (``link.command``)."""
OWN_WORDS_S: Final = 5.0
"""A source that hangs says nothing: so long after the time in which it would have."""


class NewestPicture(Record, frozen=True):
    """The newest picture; ``text`` is its base64, made once for all who look."""

    number: int
    taken_s: float
    width_px: int
    height_px: int
    text: str


class Camera:
    """Keeps the newest picture. ``pictures``, ``dropped`` and ``starts`` count."""

    def __init__(
        self,
        parameters: CameraParameters,
        bus: Bus,
        clock: Clock,
        open_source: OpenSource,
        rng: random.Random,
    ) -> None:
        self.parameters = parameters
        self._bus, self._inputs, self._open, self._rng = bus, inputs_of(clock), open_source, rng
        self._recorded = RateLimit(parameters.recorded_hz) if parameters.recorded_hz > 0 else None
        self._asked, self._asked_s = asyncio.Event(), float("-inf")
        self._waiting: set[asyncio.Future[None]] = set()
        self.data, self._is_said = CameraData(), False
        self.newest: NewestPicture | None = None
        self.pictures = self.dropped = self.starts = 0

    async def run(self) -> None:
        """Keep the camera running while somebody looks, until cancelled."""
        wait_s = 0.0
        while True:
            if not self._is_wanted():
                self._publish(replace(self.data, state="off", reason=""))
                wait_s = 0.0
                self._asked.clear()
                await self._asked.wait()
            if self.data.state != "failed":  # that stays said until there is a picture
                self._publish(replace(self.data, state="starting", reason=""))
            before = self.pictures
            reason = await self._serve_once()
            self.newest = None
            if reason:
                self._publish(replace(self.data, state="failed", reason=reason))
                self._wake()
                longer_s = 0.0 if self.pictures > before else 2 * wait_s
                wait_s = min(max(longer_s, FIRST_WAIT_S), LONGEST_WAIT_S)
                await asyncio.sleep(wait_s * self._rng.uniform(0.8, 1.2))

    async def next_picture(self, after: int, wait_s: float) -> CameraFrame:
        """The first picture with a higher number than ``after``, which switches the camera on.

        Raises:
            CameraLost: there is none within ``wait_s``, and why.
        """
        self._note_look()
        if self.newest is not None and after > self.newest.number:  # of another run of the daemon
            after = 0
        try:
            async with asyncio.timeout(wait_s):
                while (newest := self.newest) is None or newest.number <= after:
                    if self.data.state == "failed":
                        raise CameraLost(self.data.reason)
                    await self._next_change()
        except TimeoutError:
            raise CameraLost(
                Sentence(
                    "camera.none_in_time",
                    "the camera has sent no picture within {seconds:g} s",
                    seconds=wait_s,
                )
            ) from None
        self._note_look()
        age_s = max(self._inputs.now_s() - newest.taken_s, 0.0)
        return CameraFrame(
            newest.number, newest.taken_s, age_s, newest.width_px, newest.height_px, newest.text
        )

    async def _next_change(self) -> None:
        waiter = asyncio.get_running_loop().create_future()
        self._waiting.add(waiter)
        try:
            await waiter
        finally:
            self._waiting.discard(waiter)

    def _wake(self) -> None:
        for waiter in self._waiting:
            if not waiter.done():
                waiter.set_result(None)

    def _note_look(self) -> None:
        self._asked_s = self._inputs.now_s()
        self._asked.set()

    def _is_wanted(self) -> bool:
        looked_s = self._inputs.now_s() - self._asked_s
        return self._recorded is not None or bool(self._waiting) or looked_s < LINGER_S

    async def _serve_once(self) -> str:
        """Open the source, and read it until it fails, or nobody looks any more; why it has failed."""
        self.starts += 1
        try:
            source = await self._open(self.parameters)
        except CameraLost as lost:
            return lost.words
        try:
            return await self._read_pictures(source)
        except CameraLost as lost:
            return lost.words
        finally:
            await source.close()

    async def _read_pictures(self, source: PictureSource) -> str:
        patience_s = START_S
        while self._is_wanted():
            try:
                async with asyncio.timeout(patience_s):
                    arrived = await source.read()
            except TimeoutError:
                return Sentence(
                    "camera.program_hangs",
                    "its device or program hangs: nothing was heard of it for {seconds:g} s",
                    seconds=patience_s,
                )
            patience_s = self.parameters.silence_timeout_s + OWN_WORDS_S
            self._take_picture(arrived)
        return ""

    def _take_picture(self, arrived: ArrivedPicture) -> None:
        picture, taken_s = arrived.picture, self._inputs.now_s() - arrived.age_s
        self.pictures += 1
        self.dropped += arrived.dropped
        self.newest = NewestPicture(
            self.pictures,
            taken_s,
            picture.width_px,
            picture.height_px,
            base64.b64encode(picture.jpeg).decode("ascii"),
        )
        self._publish(CameraData("running", "", picture.width_px, picture.height_px))
        self._wake()
        if self._recorded is not None and self._recorded.admit_at(taken_s):
            size = len(picture.jpeg)
            event = CameraPictureTaken(taken_s, picture.width_px, picture.height_px, size, picture.jpeg)
            self._inputs.observe(self._bus, event)

    def _publish(self, data: CameraData) -> None:
        """Say how it is, if that is new."""
        if self._is_said and data == self.data:
            return
        if data.state == "failed":
            log.warning("the camera has no picture", reason=data.reason)
        self._is_said, self.data = True, data
        changed = CameraChanged(
            data.state, data.reason, data.width_px, data.height_px, stamp_s=self._inputs.now_s()
        )
        self._inputs.observe(self._bus, changed)
