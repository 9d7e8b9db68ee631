"""Converts a gamepad's stick and buttons to commands: the pure half of ``chefbotctl joystick``.

The robot moves only while the enable button is held. A button that is already held when the program starts, or when the
pad is plugged in, has no effect until it is released once. Releasing it ends only this pad's own motion. The stop button
stops the robot, whoever drives it.
"""

import math
from enum import StrEnum
from typing import TypeAlias

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.record import Record, replace

REPEAT_S = 0.05
"""20 Hz, ten times within the daemon's dead-man of 0.5 s."""


class StickScale(Record, frozen=True):
    """Speeds at full deflection, the turbo factor, and the stick's dead zone (0 to 1): options of the command."""

    linear_m_s: float = 0.2
    angular_rad_s: float = 0.8
    turbo: float = 2.0
    dead_zone: float = 0.12


class Button(StrEnum):
    """What a button is for."""

    ENABLE = "enable"
    TURBO = "turbo"
    STOP = "stop"
    ESTOP = "estop"
    ARM = "arm"


class PadReading(Record, frozen=True):
    """One reading of a pad: the stick from -1 to 1 (forward and left are positive), and the buttons held."""

    forward: float = 0.0
    left: float = 0.0
    down: frozenset[Button] = frozenset()


class PadRequest(StrEnum):
    """An order other than a velocity. ``RELEASE`` ends this pad's own motion, ``STOP`` everybody's."""

    RELEASE = "release"
    STOP = "stop"
    ESTOP = "estop"
    ARM = "arm"


Order: TypeAlias = Twist2D | PadRequest

REQUESTS = ((Button.ESTOP, PadRequest.ESTOP), (Button.STOP, PadRequest.STOP), (Button.ARM, PadRequest.ARM))
"""What each button requests; when several are pressed at once, the first one in this order counts."""


class Pad(Record, frozen=True):
    """The state after a reading. At first every button counts as held, so that each has to be released once.

    ``due_s`` is when the next velocity is due: on a fixed grid from the first one on, however late readings come.
    """

    down: frozenset[Button] = frozenset(Button)
    enabled: bool = False
    twist: Twist2D = STANDING
    due_s: float = -math.inf


INITIAL_PAD = Pad()


def step(
    scale: StickScale, pad: Pad, reading: PadReading | None, now_s: float
) -> tuple[Pad, tuple[Order, ...]]:
    """Process a reading (None: the pad is gone). Returns the next state and the orders to send now, in this order.

    A velocity is repeated every ``repeat_s`` while enabled. Releasing the button or the stick takes effect at once.
    """
    if reading is None:
        return INITIAL_PAD, _release_if(pad.enabled)
    pressed = reading.down - pad.down
    for button, request in REQUESTS:
        if button in pressed:
            return Pad(reading.down), (*_release_if(pad.enabled and request is PadRequest.ARM), request)
    if not (Button.ENABLE in pressed or (pad.enabled and Button.ENABLE in reading.down)):
        return Pad(reading.down), _release_if(pad.enabled)
    command = twist(scale, reading)
    due_s = pad.due_s if pad.enabled else now_s
    if now_s >= due_s:
        return Pad(reading.down, True, command, _next_due_s(due_s, REPEAT_S, now_s)), (command,)
    if command == STANDING != pad.twist:
        return Pad(reading.down, True, command, due_s), (command,)
    return replace(pad, down=reading.down), ()


def _next_due_s(due_s: float, repeat_s: float, now_s: float) -> float:
    """The next time on the grid after now; times that were missed are skipped."""
    return due_s + repeat_s * (math.floor((now_s - due_s) / repeat_s) + 1)


def disable_pad(pad: Pad) -> Pad:
    """The state after a refusal: the enable button has to be released and pressed again."""
    return Pad(pad.down)


def twist(scale: StickScale, reading: PadReading) -> Twist2D:
    """The velocity for a stick position."""
    gain = scale.turbo if Button.TURBO in reading.down else 1.0
    return Twist2D(
        gain * scale.linear_m_s * deflection(reading.forward, scale.dead_zone),
        gain * scale.angular_rad_s * deflection(reading.left, scale.dead_zone),
    )


def deflection(raw: float, dead_zone: float) -> float:
    """The stick's deflection beyond its dead zone, from -1 to 1, continuous at the zone's edge."""
    beyond = (min(abs(raw), 1.0) - dead_zone) / (1.0 - dead_zone)
    return math.copysign(beyond, raw) if beyond > 0 else 0.0


def _release_if(driving: bool) -> tuple[Order, ...]:
    return (PadRequest.RELEASE,) if driving else ()
