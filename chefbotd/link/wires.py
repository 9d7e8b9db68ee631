"""What others need to know of a wire by its name: wheels, sensors, the line that stops, and the bytes that it needs."""

import math
from collections.abc import Iterator, Sequence
from enum import Enum

from firmware_protocol.codec import (
    MOST_EDGES_A_LINE,
    MOST_TIMES_A_LINE,
    VARIANTS,
    Variant,
    from_board,
    to_board,
)
from firmware_protocol.messages import (
    AnalogueLevel,
    BatteryLevel,
    BoardTime,
    DutyEcho,
    FromBoard,
    Orientation,
    QuadratureEdges,
    RawImu,
    SetDuty,
    UltrasonicDistance,
)

LEAST_CYCLES_S = 20
"""A board's cycle grows with what it has to tell; below so many a second the wheels are controlled too coarsely."""

BITS_A_BYTE = 10
"""8N1: a start bit, eight of data, a stop bit."""


class Needs(Enum):
    """What a section of the configuration needs the board to tell: one of these lines."""

    ULTRASONIC = (UltrasonicDistance,)
    INFRARED = (AnalogueLevel,)
    IMU = (Orientation, RawImu)
    QUADRATURE = (QuadratureEdges,)


def variant_of(wire: str) -> Variant:
    """The variant of the board's lines that has this name; raises ``KeyError`` where none has."""
    return VARIANTS[wire]


def wires(needs: Needs | None = None) -> list[str]:
    """The name of every wire, or of each that has such a line."""
    lines = () if needs is None else needs.value
    return [name for name, variant in VARIANTS.items() if not lines or any(map(variant.speaks, lines))]


def stop_line(wire: str) -> bytes:
    """What stops the motors of a board that speaks this wire."""
    variant = variant_of(wire)
    return to_board(variant).encode(SetDuty((0,) * variant.wheels))


def needed_bytes_s(
    wire: str,
    edges_s: Sequence[float],
    *,
    analogue_inputs: int = 0,
    ultrasonic: bool = False,
    imu: bool = False,
) -> float:
    """Bytes a second for cycles of the longest lines, when the wheels' encoders have so many edges a second.

    KHAN: 1.1 m/s at a radius of 0.03 m are 36.7 rad/s, with 898 counts a turn 5,240 edges a second and 263 in a cycle of
    1/20 s. At three a character that is a line of 88 + 34 bytes for each of the four wheels, and 78 for the rest of the
    cycle (t 18, s 38, a 12, b 10): 20 (4 * 122 + 78) = 11,320 bytes a second of the 11,520 of 115200 baud.
    """
    variant = variant_of(wire)
    codec = from_board(variant)
    rest: list[FromBoard] = [
        BoardTime(2**32 - 1, 0.05),
        DutyEcho((-1023.0,) * variant.wheels),
        BatteryLevel(4095.0),
    ]
    rest += [AnalogueLevel(channel, 4095.0) for channel in range(analogue_inputs)]
    rest += [UltrasonicDistance(400)] * ultrasonic + [Orientation(-0.71, -0.71, -0.01, -0.01)] * imu
    bursts = [burst for wheel, rate in enumerate(edges_s) for burst in _bursts(wheel, rate)]
    return LEAST_CYCLES_S * sum(len(codec.encode(message)) for message in (*rest, *bursts))


def _bursts(wheel: int, edges_s: float) -> Iterator[QuadratureEdges]:
    """A wheel's lines of a cycle."""
    edges, gap_us = math.ceil(edges_s / LEAST_CYCLES_S), int(1e6 / edges_s)
    for start in range(0, edges, MOST_EDGES_A_LINE):
        count = min(MOST_EDGES_A_LINE, edges - start)
        gaps_us = (gap_us,) * (min(count, MOST_TIMES_A_LINE) - 1)
        yield QuadratureEdges(wheel, 2**16 - 1, (0,) * count, 2**32 - 1, gaps_us)
