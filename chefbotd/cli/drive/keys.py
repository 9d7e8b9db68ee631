"""Driving by keys that a terminal repeats and never releases: the pure half of teleop.

A terminal reports no key-up. A key that is held arrives once, then again after the keyboard's initial delay
(0.25 s to 0.66 s on common desktops, 0.5 s on most), and then about every 30 ms. A first press therefore counts as
held for ``first_hold_s``, which covers that delay. Once the key repeats, each repeat counts for a few intervals only:
releasing a held key stops the robot within ``shortest_hold_s`` to ``longest_hold_s`` (0.12 s at 30 ms). A single tap
drives for the whole first hold. To keep taps short on a fast keyboard and drives smooth on a slow one, the delay is
learned from the first key that is held. Any unknown key stops at once.
"""

from dataclasses import dataclass, replace

from pydantic import Field

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.parameters import Parameters

#: Which way each key drives, as signs of forward and of counter-clockwise turning.
MOVES: dict[str, tuple[int, int]] = {
    "u": (1, 1),
    "i": (1, 0),
    "o": (1, -1),
    "j": (0, 1),
    "l": (0, -1),
    "m": (-1, -1),
    ",": (-1, 0),
    ".": (-1, 1),
    "up": (1, 0),
    "left": (0, 1),
    "right": (0, -1),
    "down": (-1, 0),
}

#: By how much each key multiplies the forward and the turning speed.
SCALES: dict[str, tuple[float, float]] = {
    "q": (1.1, 1.1),
    "z": (0.9, 0.9),
    "w": (1.1, 1.0),
    "x": (0.9, 1.0),
    "e": (1.0, 1.1),
    "c": (1.0, 0.9),
}


class KeyParameters(Parameters):
    """How long a key counts as held, and the speeds it asks for."""

    first_hold_s: float = Field(0.6, gt=0, le=1)
    longest_first_hold_s: float = Field(0.8, gt=0, le=1)
    first_hold_margin_s: float = Field(0.06, ge=0, le=0.2)
    longest_repeat_s: float = Field(0.12, gt=0, le=0.2)
    hold_intervals: float = Field(3.0, ge=1, le=10)
    shortest_hold_s: float = Field(0.12, gt=0, le=0.5)
    longest_hold_s: float = Field(0.25, gt=0, le=0.5)
    linear_m_s: float = Field(0.2, gt=0)
    angular_rad_s: float = Field(0.8, gt=0)
    max_linear_m_s: float = Field(0.5, gt=0)
    max_angular_rad_s: float = Field(5.0, gt=0)


@dataclass(frozen=True, slots=True)
class Keys:
    """The state of the keys.

    ``held`` is the key that drives until ``until_s``, last seen at ``seen_s``; ``gap_s`` is the time between
    its last two arrivals as long as that may have been the keyboard's initial delay.
    """

    linear_m_s: float
    angular_rad_s: float
    first_hold_s: float
    held: str | None = None
    seen_s: float = 0.0
    until_s: float = 0.0
    gap_s: float | None = None

    def twist(self, now_s: float) -> Twist2D:
        """The velocity to command now; zero once the key counts as released."""
        if self.held is None or now_s >= self.until_s:
            return STANDING
        forward, turn = MOVES[self.held]
        return Twist2D(forward * self.linear_m_s, turn * self.angular_rad_s)


def initial_keys(parameters: KeyParameters) -> Keys:
    """Before the first key."""
    return Keys(parameters.linear_m_s, parameters.angular_rad_s, parameters.first_hold_s)


def press(parameters: KeyParameters, keys: Keys, key: str, now_s: float) -> Keys:
    """The state after a key: a motion begins or goes on, a speed changes, or (any other key) all stops."""
    if key in MOVES:
        return _move(parameters, keys, key, now_s)
    if key in SCALES:
        return _scale(parameters, keys, SCALES[key])
    return released(keys)


def released(keys: Keys) -> Keys:
    """The same speeds with no key held."""
    return replace(keys, held=None, gap_s=None)


def _scale(parameters: KeyParameters, keys: Keys, factors: tuple[float, float]) -> Keys:
    return replace(
        keys,
        linear_m_s=min(keys.linear_m_s * factors[0], parameters.max_linear_m_s),
        angular_rad_s=min(keys.angular_rad_s * factors[1], parameters.max_angular_rad_s),
    )


def _move(parameters: KeyParameters, keys: Keys, key: str, now_s: float) -> Keys:
    gap_s = now_s - keys.seen_s
    if key != keys.held or gap_s > parameters.longest_first_hold_s:
        return replace(keys, held=key, seen_s=now_s, until_s=now_s + keys.first_hold_s, gap_s=None)
    if gap_s > parameters.longest_repeat_s:
        return replace(keys, seen_s=now_s, until_s=now_s + keys.first_hold_s, gap_s=gap_s)
    hold_s = min(
        max(parameters.hold_intervals * gap_s, parameters.shortest_hold_s), parameters.longest_hold_s
    )
    return replace(_learn(parameters, keys), seen_s=now_s, until_s=now_s + hold_s, gap_s=None)


def _learn(parameters: KeyParameters, keys: Keys) -> Keys:
    """Learn the initial delay: a quick repeat shows that the gap before it was that delay."""
    if keys.gap_s is None:
        return keys
    hold_s = min(keys.gap_s + parameters.first_hold_margin_s, parameters.longest_first_hold_s)
    return replace(keys, first_hold_s=hold_s)
