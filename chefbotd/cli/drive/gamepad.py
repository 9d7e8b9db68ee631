"""A gamepad's stick and buttons turned into orders for a robot: the pure half of ``chefbotctl joystick``.

Nothing moves unless the enable button is held, and it must have been seen up before: a pad that is plugged in, or a
program that starts, with the button held down drives nothing. Letting it go ends this pad's own motion and no other's: a
button of its own stops the robot, whoever drives it.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

from pydantic import Field

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.parameters import Parameters


class PadParameters(Parameters):
    """Speeds at full deflection, what ``turbo`` multiplies them by, and the share of a stick that is no motion."""

    linear_m_s: float = Field(0.2, gt=0, le=5)
    angular_rad_s: float = Field(0.8, gt=0, le=20)
    turbo: float = Field(2.0, ge=1, le=10)
    dead_zone: float = Field(0.12, ge=0, lt=1)
    repeat_s: float = Field(0.05, gt=0, le=0.1)


class Button(StrEnum):
    """What a button is for."""

    ENABLE = "enable"
    TURBO = "turbo"
    STOP = "stop"
    ESTOP = "estop"
    ARM = "arm"


@dataclass(frozen=True, slots=True)
class Reading:
    """A look at a pad: the stick from -1 to 1, away from the driver and to the left being positive; buttons down."""

    forward: float = 0.0
    left: float = 0.0
    down: frozenset[Button] = frozenset()


class Demand(StrEnum):
    """An order that is no velocity; ``LET_GO`` ends what the pad has asked for, ``STOP`` what anybody has."""

    LET_GO = "let_go"
    STOP = "stop"
    ESTOP = "estop"
    ARM = "arm"


Order: TypeAlias = Twist2D | Demand

DEMANDS = ((Button.ESTOP, Demand.ESTOP), (Button.STOP, Demand.STOP), (Button.ARM, Demand.ARM))
"""What a press demands; of several at once the first counts."""


@dataclass(frozen=True, slots=True)
class Pad:
    """What the last look left behind; at first every button counts as held, so that each has to be let go once.

    ``due_s`` is the next turn of a velocity: turns are on a grid from the first one on, however late a look comes.
    """

    down: frozenset[Button] = frozenset(Button)
    enabled: bool = False
    twist: Twist2D = STANDING
    due_s: float = -math.inf


UNTOUCHED = Pad()


def step(
    parameters: PadParameters, pad: Pad, reading: Reading | None, now_s: float
) -> tuple[Pad, tuple[Order, ...]]:
    """Take a look (None: the pad is gone): the next state, and what to ask of the robot now, in this order.

    A velocity is repeated every ``repeat_s`` while enabled; letting go of the button or of the stick is told at once.
    """
    if reading is None:
        return UNTOUCHED, _let_go_if(pad.enabled)
    pressed = reading.down - pad.down
    for button, demand in DEMANDS:
        if button in pressed:
            return Pad(reading.down), (*_let_go_if(pad.enabled and demand is Demand.ARM), demand)
    if not (Button.ENABLE in pressed or (pad.enabled and Button.ENABLE in reading.down)):
        return Pad(reading.down), _let_go_if(pad.enabled)
    wanted = twist(parameters, reading)
    due_s = pad.due_s if pad.enabled else now_s
    if now_s >= due_s:
        return Pad(reading.down, True, wanted, _next_turn_s(due_s, parameters.repeat_s, now_s)), (wanted,)
    if wanted == STANDING != pad.twist:
        return Pad(reading.down, True, wanted, due_s), (wanted,)
    return replace(pad, down=reading.down), ()


def _next_turn_s(due_s: float, repeat_s: float, now_s: float) -> float:
    """The first turn after now; those that were missed are left out, and not made up for."""
    return due_s + repeat_s * (math.floor((now_s - due_s) / repeat_s) + 1)


def disabled(pad: Pad) -> Pad:
    """After a refusal: the button has to be let go and pressed again."""
    return Pad(pad.down)


def twist(parameters: PadParameters, reading: Reading) -> Twist2D:
    """The velocity that the stick asks for."""
    gain = parameters.turbo if Button.TURBO in reading.down else 1.0
    return Twist2D(
        gain * parameters.linear_m_s * deflection(reading.forward, parameters.dead_zone),
        gain * parameters.angular_rad_s * deflection(reading.left, parameters.dead_zone),
    )


def deflection(raw: float, dead_zone: float) -> float:
    """The stick beyond its dead zone, from -1 to 1 and without a jump at the zone's edge."""
    beyond = (min(abs(raw), 1.0) - dead_zone) / (1.0 - dead_zone)
    return math.copysign(beyond, raw) if beyond > 0 else 0.0


def _let_go_if(driving: bool) -> tuple[Order, ...]:
    return (Demand.LET_GO,) if driving else ()
