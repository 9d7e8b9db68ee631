"""The wheels as they are built: side, size, wiring, and position along the robot."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Wheel:
    """A driven wheel; a sign of -1 is a motor or an encoder that was wired backwards."""

    is_left: bool
    radius_m: float
    motor_sign: int = 1
    encoder_sign: int = 1


@dataclass(frozen=True, slots=True)
class Chassis:
    """The wheels in the order of the wire, how far the sides are apart, and the counts of a wheel's turn.

    Raises:
        ValueError: a side has no wheel.
    """

    wheels: tuple[Wheel, ...]
    track_width_m: float
    counts_per_turn: float

    def __post_init__(self) -> None:
        if {wheel.is_left for wheel in self.wheels} != {True, False}:
            raise ValueError(f"there must be at least one wheel on each side, got {self.wheels}")

    def on_side_of(self, wheel: Wheel) -> int:
        """How many wheels there are on the side of this one, itself included."""
        return sum(other.is_left == wheel.is_left for other in self.wheels)


PUBLISHED = Chassis((Wheel(True, 0.045), Wheel(False, 0.045)), track_width_m=0.3, counts_per_turn=4200.0)
"""ChefBot's."""
