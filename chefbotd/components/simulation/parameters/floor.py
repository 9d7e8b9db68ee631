"""Where the floor is not level or not rough: for the physics of MuJoCo."""

from enum import StrEnum
from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters


class FloorKind(StrEnum):
    """What a part of the floor is.

    ``bump``: a sill with a round top. ``ramp``: up over a third of its length, level, and down again. ``slippery``: a
    patch with another friction.
    """

    BUMP = "bump"
    RAMP = "ramp"
    SLIPPERY = "slippery"


class FloorParameters(Parameters):
    """A rectangle of the floor about a place, ``length_m`` along its heading (CCW positive) and ``width_m`` across."""

    kind: FloorKind
    """A ``bump`` is a sill with a round top, a ``ramp`` goes up, is level and goes down, ``slippery`` has another
    friction."""
    x_m: float
    """Where its middle is, x in the world."""
    y_m: float
    """Where its middle is, y in the world."""
    heading_rad: float = 0.0
    """The direction along which it lies, counter-clockwise."""
    length_m: float = Field(gt=0, le=20)
    """How long it is along that direction."""
    width_m: float = Field(1.0, gt=0, le=20)
    """How wide it is across."""
    height_m: float = Field(0.0, ge=0, le=1)
    """How high a bump or a ramp is."""
    friction: float = Field(0.1, ge=0, le=2)
    """The friction of a slippery patch."""

    @model_validator(mode="after")
    def _is_high(self) -> Self:
        if not self.height_m and self.kind is not FloorKind.SLIPPERY:
            raise ValueError(f"a {self.kind.value} needs a height_m above 0")
        return self
