"""Listens at a port. It writes nothing, except a lidar's question if asked to."""

import asyncio

from chefbotd.clock import Clock
from chefbotd.core.record import Record
from chefbotd.doctor.lines import LinesHeard
from chefbotd.doctor.listening.line_survey import LineSurvey
from chefbotd.link.port import LinkParameters
from chefbotd.link.reconnect import Opener
from firmware_protocol.lidar import ld19, rplidar

USUAL_BAUDS = (115_200, 230_400, 57_600, 9_600, 38_400, 19_200, 256_000)
"""The boards' and the RPLIDAR's first, then the LD06's and LD19's, then what sketches are often set to."""

ANSWER_S = 0.5
"""The wait for an RPLIDAR's answer, which comes at once."""

ENOUGH_PACKETS = 5


class Listened(Record, frozen=True):
    """What was read at a port, in pieces with the time of each; ``lost`` says why it ended early (empty: it did not)."""

    baud: int
    seconds: float
    pieces: tuple[tuple[float, bytes], ...] = ()
    lost: str = ""

    @property
    def data(self) -> bytes:
        """All bytes."""
        return b"".join(piece for _, piece in self.pieces)


class _Listener(asyncio.Protocol):
    """Keeps the received bytes."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.pieces: list[tuple[float, bytes]] = []
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def data_received(self, data: bytes) -> None:
        self.pieces.append((self._clock.now_s(), data))

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.lost.done():
            self.lost.set_result(str(exc) if exc else "closed")


async def listen(
    opener: Opener, link: LinkParameters, clock: Clock, seconds: float, *, question: bytes = b""
) -> Listened:
    """Open the port, write ``question`` (nothing, for a board), listen, and close it.

    Raises:
        OSError: it cannot be opened; the message says why.
    """
    listener = _Listener(clock)
    transport = await opener(link, listener)
    try:
        if question:
            transport.write(question)
        done, _ = await asyncio.wait([listener.lost], timeout=seconds)
        lost = listener.lost.result() if done else ""
    finally:
        transport.abort()
    await asyncio.sleep(0)  # the loop closes the port after this turn
    return Listened(link.baud, seconds, tuple(listener.pieces), lost)


def survey(listened: Listened, configured_wire: str) -> LinesHeard:
    """What was read, decoded as a board's lines."""
    if not listened.pieces:
        return LinesHeard(seconds=listened.seconds)
    lines = LineSurvey(configured_wire, listened.pieces[-1][0] - listened.seconds)
    for stamp_s, piece in listened.pieces:
        lines.feed(piece, stamp_s)
    return lines.heard(listened.pieces[-1][0])


def ld_packets(listened: Listened) -> int:
    """How many good packets of an LD06 or LD19 these bytes hold."""
    decoder = ld19.Ld19Decoder()
    decoder.feed_bytes(listened.data)
    return decoder.packets


def rplidar_model(listened: Listened) -> str:
    """The model of the RPLIDAR that answered; empty if none did."""
    for answer in rplidar.RplidarDecoder().feed_bytes(listened.data):
        if isinstance(answer, rplidar.DeviceInfo):
            major, minor = answer.firmware
            return f"RPLIDAR A{answer.model >> 4} (model 0x{answer.model:02x}, firmware {major}.{minor:02d})"
    return ""


RPLIDAR_QUESTION = rplidar.request(rplidar.RequestCode.GET_INFO)
"""A5 50: no line of any board's, which ends at CR. It is asked only where nothing was heard (assumed to be harmless)."""


def rplidar_link(device: str) -> LinkParameters:
    """How an RPLIDAR's port is opened."""
    return LinkParameters(device=device, baud=rplidar.BAUD, dtr=False)
