"""A bad cable: bytes that arrive with a flipped bit, not at all, or twice, and noise between them.

Which bytes are hit depends on the seed and on their place in the stream, never on the chunks.
"""

import math
import random
import sys
from collections import Counter
from enum import StrEnum

from pydantic import Field

from chefbotd.core.parameters import Parameters


class Fault(StrEnum):
    """What happens to a byte: one of its bits flips, it is lost, it comes twice, noise comes after it."""

    FLIP = "flip"
    DROP = "drop"
    DOUBLE = "double"
    NOISE = "noise"


class CableParameters(Parameters):
    """The share of bytes that suffer each fault; together they must leave some bytes alone."""

    flip_share: float = Field(default=0.0, ge=0, le=0.2)
    drop_share: float = Field(default=0.0, ge=0, le=0.2)
    double_share: float = Field(default=0.0, ge=0, le=0.2)
    noise_share: float = Field(default=0.0, ge=0, le=0.2)


class BadCable:
    """One direction of a cable; ``counts`` says how often each fault happened."""

    def __init__(self, parameters: CableParameters, seed: int) -> None:
        shares = (
            parameters.flip_share,
            parameters.drop_share,
            parameters.double_share,
            parameters.noise_share,
        )
        self._faults, self._shares, self._share = tuple(Fault), shares, sum(shares)
        self._chance = random.Random(seed)
        self._intact = self._intact_run()
        self.counts: Counter[Fault] = Counter()

    def carry(self, data: bytes) -> bytes:
        """What arrives of the next bytes that are sent."""
        arrived, start = bytearray(), 0
        while (hit := start + self._intact) < len(data):
            arrived += data[start:hit] + self._damaged(data[hit])
            start, self._intact = hit + 1, self._intact_run()
        self._intact -= len(data) - start
        return bytes(arrived + data[start:])

    def _intact_run(self) -> int:
        """How many bytes pass before the next is hit: geometric, as when each is hit with the same chance."""
        if not self._share:
            return sys.maxsize
        return math.floor(math.log(1.0 - self._chance.random()) / math.log1p(-self._share))

    def _damaged(self, byte: int) -> bytes:
        (fault,) = self._chance.choices(self._faults, self._shares)
        self.counts[fault] += 1
        match fault:
            case Fault.FLIP:
                return bytes([byte ^ 1 << self._chance.randrange(8)])
            case Fault.DROP:
                return b""
            case Fault.DOUBLE:
                return bytes([byte, byte])
            case _:
                return bytes([byte, self._chance.randrange(256)])
