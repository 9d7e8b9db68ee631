"""What came of an order and of each of its legs. It loads no compiler, so that a screen can be drawn on any computer."""

from dataclasses import dataclass

Disc = tuple[float, float, float]
"""x, y and radius in metres."""


@dataclass(frozen=True, slots=True)
class Leg:
    """From where the robot stood to a place. ``end`` is the goal's, ``reason`` its sentence.

    ``closest_m`` is the least distance of the robot's outline from anything that it could bump into, as far as its own
    motion led there; ``closest_of_all_m`` counts also who walked up to it.
    """

    place: str
    end: str
    reason: str
    length_m: float
    shortest_m: float
    seconds: float
    ideal_s: float
    closest_m: float
    closest_of_all_m: float
    off_m: float
    off_rad: float
    touched: bool

    @property
    def failure(self) -> str | None:
        """Why this leg does not count as done."""
        if self.end != "reached":
            return f"{self.place}: {self.reason or self.end}"
        if self.touched:
            return f"{self.place}: it touched something"
        return None


@dataclass(frozen=True, slots=True)
class Found:
    """How it found out where it was: after how long, and how far from the truth."""

    seconds: float
    off_m: float
    off_rad: float
    turned: bool


@dataclass(frozen=True, slots=True)
class Served:
    """What came of it."""

    found: Found
    legs: tuple[Leg, ...]
    seconds: float

    @property
    def failures(self) -> tuple[str, ...]:
        """Why it does not count as done; nothing where it does."""
        return tuple(leg.failure for leg in self.legs if leg.failure is not None)
