"""What may be wrong between the simulated robot and its daemon: broken encoders, false readings, a bad cable."""

import math
from collections.abc import Callable, Mapping

from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.transport import FakeSerialTransport
from firmware_protocol.checked import seal, unseal
from tests.fakes.bad_cable import BadCable, CableParameters

FASTEST_M_S = 0.65
"""Asked for 0.2 m/s: a damaged command is obeyed until the next. Over twelve seeds: 0.30 on ChefBot, 0.43 on KHAN."""

DISARMING: Mapping[str, frozenset[str]] = {
    "flip": frozenset({"board_restarted", "echo_mismatch", "wheel_reversed", "wheel_stalled"}),
    "drop": frozenset({"echo_mismatch", "wheel_reversed"}),
    "double": frozenset({"echo_mismatch", "overspeed"}),
}
"""What damage both ways ends in, where the robot does not drive on.

A flipped ``s`` reset the board, or it did other than it was told, and met a wall.
"""

Rewrite = Callable[[list[bytes]], list[bytes] | None]


def opened(line: bytes, separator: bytes) -> tuple[bytes, int | None]:
    """A line's body and its sequence number; a classic line has none."""
    return unseal(line, separator) or (line, None)


def closed(body: bytes, sequence: int | None, separator: bytes) -> bytes:
    """The line of a body, sealed as it was."""
    return body if sequence is None else seal(body, sequence, separator)


def rewire(robot: SimulatedRobot, kind: bytes, rewrite: Rewrite) -> None:
    """From now on the fields of these lines pass through ``rewrite``; None is a line that never comes."""
    feed = robot.device.transport.feed

    def line(text: bytes) -> bytes:
        body, sequence = opened(text, b"\t")
        fields = body.split(b"\t")
        if fields[0] != kind:
            return text + b"\n"
        changed = rewrite(fields[1:])
        return b"" if changed is None else closed(b"\t".join([kind, *changed]), sequence, b"\t") + b"\n"

    robot.device.transport.feed = lambda data: feed(b"".join(line(t) for t in data.splitlines()))


def rewire_motor(robot: SimulatedRobot, index: int) -> None:
    """From now on this wheel turns the other way than it is told; the board, which cannot know, echoes what it heard."""
    write = robot.device.on_write

    def line(text: bytes) -> bytes:
        body, sequence = opened(text, b" ")
        kind, *duties = body.split(b" ")
        if kind == b"s":
            duties[index] = b"%d" % -int(duties[index])
        return closed(b" ".join([kind, *duties]), sequence, b" ") + b"\r"

    def echo(duties: list[bytes]) -> list[bytes]:
        heard = b"%.2f" % -float(duties[index]) if b"." in duties[index] else b"%d" % -int(duties[index])
        return [*duties[:index], heard, *duties[index + 1 :]]

    robot.device.on_write = lambda data: write(b"".join(line(text) for text in data.split(b"\r")[:-1]))
    rewire(robot, b"s", echo)


def frozen(index: int) -> Rewrite:
    """An encoder that was unplugged: its counts stand still."""
    kept: list[bytes] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        kept[:] = kept or [counts[index]]
        return [*counts[:index], kept[0], *counts[index + 1 :]]

    return rewrite


def reversed_from_now(index: int) -> Rewrite:
    """An encoder whose two channels were exchanged: it counts backwards from where it is."""
    start: list[int] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        start[:] = start or [int(counts[index])]
        backwards = b"%d" % (2 * start[0] - int(counts[index]))
        return [*counts[:index], backwards, *counts[index + 1 :]]

    return rewrite


def jumping(index: int) -> Rewrite:
    """An encoder whose every reading is somewhere else."""
    seen: list[bytes] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        seen.append(counts[index])
        elsewhere = b"%d" % (int(counts[index]) + 100_000 * (-1) ** len(seen) * len(seen))
        return [*counts[:index], elsewhere, *counts[index + 1 :]]

    return rewrite


def slipping(index: int, extra_counts: int = 40) -> Rewrite:
    """A wheel that loses its grip every second for a quarter of one: it turns so much farther in each reading."""
    heard = spun = 0

    def rewrite(counts: list[bytes]) -> list[bytes]:
        nonlocal heard, spun
        heard += 1
        spun += extra_counts if heard % 50 < 12 else 0
        return [*counts[:index], b"%d" % (int(counts[index]) + spun), *counts[index + 1 :]]

    return rewrite


def transport_of(robot: SimulatedRobot) -> FakeSerialTransport:
    """The cable, which must be plugged in."""
    transport = robot.device.transport
    assert transport is not None
    return transport


def misread(data: bytes, ratio: float) -> bytes:
    """What a UART reads of 8N1 bytes that come without a pause, sent at ``ratio`` times its own rate."""
    line = [level for byte in data for level in (0, *(byte >> bit & 1 for bit in range(8)), 1)]
    read, at = bytearray(), 0
    while (start := _falling_edge(line, at)) is not None:
        samples = [start + (bit + 0.5) * ratio for bit in range(10)]
        levels = [line[int(sample)] if sample < len(line) else 1 for sample in samples]
        read.append(sum(level << bit for bit, level in enumerate(levels[1:9])))
        at = math.ceil(samples[9])
    return bytes(read)


def _falling_edge(line: list[int], at: int) -> int | None:
    """Where the next start bit begins; the line is high when nothing is sent."""
    for index in range(at, len(line)):
        if line[index] == 0 and (index == 0 or line[index - 1] == 1):
            return index
    return None


def damage(robot: SimulatedRobot, shares: dict[str, float], seed: int) -> None:
    """Put a bad cable into both directions."""
    transport, parameters = robot.device.transport, CableParameters(**shares)
    heard, said = BadCable(parameters, seed), BadCable(parameters, seed + 1)
    feed, write = transport.feed, robot.device.on_write
    transport.feed = lambda data: feed(heard.carry(data))
    robot.device.on_write = lambda data: write(said.carry(data))
