"""Robot twist to wheel speeds and back, for any number of wheels a side (differential and skid steer)."""

from collections.abc import Sequence
from enum import StrEnum
from operator import mul
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from chefbotd.core.geometry import Twist2D
from chefbotd.core.parameters import Parameters

RadiusMultiplier = Annotated[float, Field(ge=0.5, le=2.0)]


ALL_WHEELS = "all"
"""Every wheel, where gains are changed; no wheel has this name."""


class Side(StrEnum):
    """Which side of the robot a wheel is on, seen in the direction of travel."""

    LEFT = "left"
    RIGHT = "right"


ONLY_TWO_SIDES = (
    "chefbotd drives robots whose wheels stand on two sides and do not steer (differential drive, skid steer); omni and "
    "mecanum wheels and steered ones (Ackermann) it cannot drive"
)


class WheelParameters(Parameters):
    """One driven wheel; a sign of -1 turns round an encoder or a motor that was wired backwards."""

    name: str = Field(min_length=1)
    """The wheel's name in messages, topics and other sections; each has its own."""
    side: Side
    """The side of the robot on which the wheel is, seen in driving direction."""
    radius_m: float = Field(gt=0, le=1)
    """The radius of the wheel with its tyre under the robot's load."""
    encoder_sign: Literal[1, -1] = 1
    """-1 where the counts fall when the wheel rolls forward."""
    motor_sign: Literal[1, -1] = 1
    """-1 where a positive duty turns the wheel backward."""

    @field_validator("side", mode="before")
    @classmethod
    def _is_left_or_right(cls, side: object) -> object:
        """Who describes a robot of another kind is told so at once."""
        if side not in tuple(Side):
            raise ValueError(f"expected left or right, got {side!r}: {ONLY_TWO_SIDES}")
        return side


class ChassisParameters(Parameters):
    """The wheels, in the order in which the wire counts and commands them, and how far apart the sides are.

    ``track_width_m`` is measured, wheel centre to wheel centre. The multipliers are what calibration finds: of a whole
    side's radii, and of the track (a robot whose wheels skid when it turns behaves like a wider one).
    """

    track_width_m: float = Field(gt=0, le=5)
    track_multiplier: float = Field(default=1.0, ge=0.5, le=4.0)
    """What turns show of the track, as a factor: wheels that skid make a robot turn as if it were wider."""
    wheels: tuple[WheelParameters, ...]
    left_radius_multiplier: RadiusMultiplier = 1.0
    """A factor on the radii of the left wheels."""
    right_radius_multiplier: RadiusMultiplier = 1.0
    """A factor on the radii of the right wheels."""

    @model_validator(mode="after")
    def _can_drive(self) -> Self:
        names = [wheel.name for wheel in self.wheels]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"wheel names must be unique, repeated: {', '.join(repeated)}")
        for side in Side:
            if not any(wheel.side is side for wheel in self.wheels):
                raise ValueError(f"there must be at least one wheel on the {side} side, got {names}")
        return self

    @property
    def is_skid_steer(self) -> bool:
        """Whether a side has several wheels, which skid in every turn."""
        return len(self.wheels) > len(Side)

    @property
    def effective_track_m(self) -> float:
        """How wide the robot is as turning goes."""
        return self.track_width_m * self.track_multiplier


class Kinematics:
    """A chassis' conversions, with what never changes computed once.

    Tuples are per wheel, in the order of the configured wheels; radii and track are the effective ones. ``left`` and
    ``right`` are the indices of each side's wheels.
    """

    def __init__(self, chassis: ChassisParameters) -> None:
        multiplier = {Side.LEFT: chassis.left_radius_multiplier, Side.RIGHT: chassis.right_radius_multiplier}
        self.track_width_m = chassis.effective_track_m
        half_track_m = self.track_width_m / 2
        self.radii_m = tuple(wheel.radius_m * multiplier[wheel.side] for wheel in chassis.wheels)
        self._levers_m = tuple(-half_track_m if w.side is Side.LEFT else half_track_m for w in chassis.wheels)
        self.left = tuple(i for i, wheel in enumerate(chassis.wheels) if wheel.side is Side.LEFT)
        self.right = tuple(i for i, wheel in enumerate(chassis.wheels) if wheel.side is Side.RIGHT)
        self._is_left_right = (self.left, self.right) == ((0,), (1,))

    def rims_at_m_s(self, velocity_rad_s: Sequence[float]) -> tuple[float, ...]:
        """How fast the rims of wheels go that turn so fast."""
        return tuple(map(mul, velocity_rad_s, self.radii_m))

    def rim_speeds_m_s(self, twist: Twist2D) -> tuple[float, ...]:
        """How fast each wheel's rim must roll over the ground for the robot to move so."""
        linear_m_s, angular_rad_s = twist.linear_m_s, twist.angular_rad_s
        return tuple([linear_m_s + angular_rad_s * lever_m for lever_m in self._levers_m])

    def side_travel_m(
        self, travel_rad: Sequence[float], excluded: tuple[int, ...] = ()
    ) -> tuple[float, float]:
        """How far the left and the right side rolled: the mean over each side's wheels, but for those left out.

        Works on speeds as well: rad/s in, m/s out. Raises ``ValueError`` unless there is one number per
        wheel, and a wheel left on each side.
        """
        if self._is_left_right and not excluded:
            left_rad, right_rad = travel_rad
            left_radius_m, right_radius_m = self.radii_m
            return left_rad * left_radius_m, right_rad * right_radius_m
        left, right = self.left, self.right
        rolled_m = [angle * radius_m for angle, radius_m in zip(travel_rad, self.radii_m, strict=True)]
        if excluded:
            left, right = without(left, excluded), without(right, excluded)
        return _mean(rolled_m, left), _mean(rolled_m, right)

    def travel_weights(self, excluded: tuple[int, ...] = ()) -> tuple[tuple[float, float], ...]:
        """How far the robot comes ahead (m) and turns left (rad) for each radian of each wheel.

        For short ways, on which metres ahead and radians may be added up. Wheels that are left out weigh nothing.
        """
        unit = (0.0,) * len(self.radii_m)
        weights = []
        for index in range(len(self.radii_m)):
            left_m, right_m = self.side_travel_m((*unit[:index], 1.0, *unit[index + 1 :]), excluded)
            weights.append(((left_m + right_m) / 2, (right_m - left_m) / self.track_width_m))
        return tuple(weights)

    def twist(self, velocity_rad_s: Sequence[float], excluded: tuple[int, ...] = ()) -> Twist2D:
        """How the robot moves when its wheels turn so and none of them slips, but for those left out."""
        left_m_s, right_m_s = self.side_travel_m(velocity_rad_s, excluded)
        return Twist2D((left_m_s + right_m_s) / 2, (right_m_s - left_m_s) / self.track_width_m)

    def saturate(self, twist: Twist2D, max_rim_speed_m_s: float) -> Twist2D:
        """The twist, slowed as a whole until its fastest rim can follow: the path keeps its curvature."""
        fastest_m_s = abs(twist.linear_m_s) + abs(twist.angular_rad_s) * self.track_width_m / 2
        if fastest_m_s <= max_rim_speed_m_s:
            return twist
        scale = max_rim_speed_m_s / fastest_m_s
        return Twist2D(twist.linear_m_s * scale, twist.angular_rad_s * scale)


def _mean(values: Sequence[float], wheels: tuple[int, ...]) -> float:
    if len(wheels) == 1:
        return values[wheels[0]]
    if not wheels:
        raise ValueError("every wheel of a side is excluded, so the distance that it rolled is unknown")
    return sum([values[i] for i in wheels]) / len(wheels)


def without(wheels: tuple[int, ...], excluded: tuple[int, ...]) -> tuple[int, ...]:
    """The wheels that are not left out."""
    return tuple([i for i in wheels if i not in excluded])


def places_x_m(is_left: Sequence[bool], wheelbase_m: float) -> tuple[float, ...]:
    """How far ahead of the middle each wheel is; ``is_left`` tells each one's side.

    A side's wheels are spread evenly over the wheelbase, the first to the front; an only one is in the middle.
    """
    places, before = [], {True: 0, False: 0}
    for left in is_left:
        gaps = is_left.count(left) - 1
        behind = before[left] / gaps if gaps else 0.5
        places.append(wheelbase_m / 2 - wheelbase_m * behind)
        before[left] += 1
    return tuple(places)
