"""The serial ports that are plugged in, and with listening what is behind each."""

from collections.abc import AsyncIterator, Sequence

from chefbotd.clock import Clock
from chefbotd.core.record import Record
from chefbotd.doctor.lines import LinesHeard
from chefbotd.doctor.sketches import TITLES, recognise
from chefbotd.link.listener import (
    ANSWER_S,
    ENOUGH_PACKETS,
    RPLIDAR_QUESTION,
    USUAL_BAUDS,
    Listened,
    ld_packets,
    listen,
    rplidar_link,
    rplidar_model,
    survey,
)
from chefbotd.link.port import LinkParameters
from chefbotd.link.ports import SerialPort
from chefbotd.link.reconnect import Opener

FIRST_S, NEXT_S = 2.5, 1.0
"""A board that the opening has reset is silent for two seconds; an echo that is missing silences it for one."""

CLASSIC = "classic"


class Behind(Record, frozen=True):
    """What was found behind a port: ``kind`` is board, ld06_ld19, rplidar, text, garbage, silent, or not_looked."""

    device: str
    kind: str
    told: str
    baud: int | None = None


async def look_behind(ports: Sequence[SerialPort], opener: Opener, clock: Clock) -> AsyncIterator[Behind]:
    """Listen at each port that is free and ours to open."""
    for port in ports:
        if port.held_by:
            yield Behind(port.device, "not_looked", f"held by {port.held_by}")
        elif port.permission:
            yield Behind(port.device, "not_looked", f"permission denied: {port.permission}")
        else:
            try:
                yield await _listen_at(port.device, opener, clock)
            except OSError as error:
                told = str(error).removeprefix(f"{port.device}: ")
                yield Behind(port.device, "not_looked", f"cannot be opened: {told}")


async def _listen_at(device: str, opener: Opener, clock: Clock) -> Behind:
    """At one rate after the other, until something is understood. Where nothing is heard at all, an RPLIDAR is asked."""
    heard: Listened | None = None
    for baud in USUAL_BAUDS:
        link = LinkParameters(device=device, baud=baud)
        listened = await listen(opener, link, clock, FIRST_S if heard is None else NEXT_S)
        if (found := _understood(device, listened)) is not None:
            return found
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
    """Two bytes that no board takes for a line; nothing was heard of one here for longer than any is silent."""
    link = rplidar_link(device)
    answer = await listen(opener, link, clock, ANSWER_S, question=RPLIDAR_QUESTION)
    if model := rplidar_model(answer):
        return Behind(device, "rplidar", f"a lidar {model}", link.baud)
    return Behind(
        device, "silent", "nothing is heard: is it powered? (a board without power, another device)"
    )
