"""The serial ports of this computer, who has them, and with listening what is behind each."""

import asyncio
import os
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

from serial.tools import list_ports

from chefbotd.clock import Clock
from chefbotd.components.doctor.algorithms.lines import LinesHeard
from chefbotd.components.doctor.algorithms.sketches import TITLES, recognise
from chefbotd.components.doctor.listening.line_survey import LineSurvey
from chefbotd.core.record import Record
from chefbotd.link.cannot_open import BY_ID, UNKNOWN, names_by_device, owner_of, permission_advice
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


def rplidar_link(device: str, baud: int = rplidar.BAUD) -> LinkParameters:
    """How an RPLIDAR's port is opened."""
    return LinkParameters(device=device, baud=baud, dtr=False)


FIRST_S, NEXT_S = 2.5, 1.0
"""A board that the opening has reset is silent for two seconds; an echo that is missing silences it for one."""

CLASSIC = "classic"


class SerialPort(Record, frozen=True):
    """A port as it is plugged in. ``permission`` says what to do where we may not open it, ``held_by`` who has it."""

    device: str
    by_id: str = ""
    usb_id: str = ""
    driver: str = ""
    product: str = ""
    permission: str = ""
    held_by: str = ""
    serial_number: str = ""


def serial_ports(devices: Sequence[str] = (), by_id: Path = BY_ID) -> list[SerialPort]:
    """These devices (a pseudo-terminal is in no list), or else every serial port of the computer."""
    names = names_by_device(by_id)
    usb_by_device = {port.device: port for port in list_ports.comports()}
    return [
        _describe_port(device, usb_by_device.get(device), names)
        for device in devices or sorted(usb_by_device)
    ]


def _describe_port(device: str, usb: object, names: dict[Path, str]) -> SerialPort:
    vendor, product = getattr(usb, "vid", None), getattr(usb, "pid", None)
    return SerialPort(
        device=device,
        by_id=names.get(Path(device).resolve(), ""),
        usb_id="" if vendor is None or product is None else f"{vendor:04x}:{product:04x}",
        driver=_driver(device),
        product=getattr(usb, "description", None) or "",
        permission=permission_problem(device) if Path(device).exists() else "there is no such device",
        held_by=holder(device),
        serial_number=getattr(usb, "serial_number", None) or "",
    )


def _driver(device: str, tty: Path = Path("/sys/class/tty")) -> str:
    try:
        return (tty / Path(device).resolve().name / "device" / "driver").resolve(strict=True).name
    except OSError:
        return ""


def permission_problem(device: str) -> str:
    """What to do where we may not read and write a device that is there; empty where we may."""
    if not Path(device).exists() or os.access(device, os.R_OK | os.W_OK):
        return ""
    return permission_advice(device)


def holder(device: str) -> str:
    """The programs that have a device open or locked, as far as we may see; empty: none."""
    try:
        owner = owner_of(device)
    except OSError:
        return ""
    return "" if owner == UNKNOWN else owner


class Behind(Record, frozen=True):
    """The device behind a port: ``kind`` is board, ld06_ld19, rplidar, text, garbage, silent, or not_looked."""

    device: str
    kind: str
    told: str
    baud: int | None = None


async def look_behind(ports: Sequence[SerialPort], opener: Opener, clock: Clock) -> AsyncIterator[Behind]:
    """Listen at each port that is free and that this user may open."""
    for port in ports:
        if port.held_by:
            yield Behind(port.device, "not_looked", f"held by {port.held_by}")
        elif port.permission:
            yield Behind(port.device, "not_looked", f"permission denied: {port.permission}")
        else:
            try:
                yield await _listen_at(port.device, opener, clock)
            except OSError as error:
                reason = str(error).removeprefix(f"{port.device}: ")
                yield Behind(port.device, "not_looked", f"cannot be opened: {reason}")


async def _listen_at(device: str, opener: Opener, clock: Clock) -> Behind:
    """Listen at one rate after the other until lines are decoded. If no byte comes, ask whether it is an RPLIDAR."""
    heard: Listened | None = None
    for baud in USUAL_BAUDS:
        link = LinkParameters(device=device, baud=baud)
        listened = await listen(opener, link, clock, FIRST_S if heard is None else NEXT_S)
        if (board := _understood(device, listened)) is not None:
            return board
        if not listened.pieces and heard is None:
            return await _ask(device, opener, clock)
        heard = listened if heard is None else heard
    lines = LinesHeard(0.0) if heard is None else survey(heard, CLASSIC)
    if lines.is_garbled:
        return Behind(device, "garbage", f"bytes that mean nothing at any usual rate: {lines.sample}")
    return Behind(device, "text", f"text, and no board's: {lines.sample}")


def _understood(device: str, listened: Listened) -> Behind | None:
    if ld_packets(listened) >= ENOUGH_PACKETS:
        return Behind(device, "ld06_ld19", "a lidar LD06 or LD19", listened.baud)
    lines = survey(listened, CLASSIC)
    if not lines.is_board:
        return None
    guess = recognise(lines)
    sketch = "an unknown sketch" if guess.sketch is None else TITLES[guess.sketch]
    return Behind(device, "board", f"a board with {sketch} ({guess.reason})", listened.baud)


async def _ask(device: str, opener: Opener, clock: Clock) -> Behind:
    """The question to an RPLIDAR: two bytes that are no line to a board, and no board is silent for so long."""
    for baud in (rplidar.BAUD, *rplidar.OTHER_BAUDS):
        answer = await listen(opener, rplidar_link(device, baud), clock, ANSWER_S, question=RPLIDAR_QUESTION)
        if model := rplidar_model(answer):
            return Behind(device, "rplidar", f"a lidar {model}", baud)
    return Behind(
        device, "silent", "nothing is heard: is it powered? (a board without power, another device)"
    )
