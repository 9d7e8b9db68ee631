"""Driving by keys that a terminal repeats and never releases: the pure half of teleop.

A terminal reports no key-up. A key that is held arrives once, then again after the keyboard's initial delay
(0.25 s to 0.66 s on common desktops, 0.5 s on most), and then about every 30 ms. A first press therefore counts as
held for ``first_hold_s``, which covers that delay. Once the key repeats, each repeat counts for a few intervals only:
releasing a held key stops the robot within ``SHORTEST_HOLD_S`` to ``LONGEST_HOLD_S`` (0.12 s at 30 ms). A single tap
drives for the whole first hold. To keep taps short on a fast keyboard and drives smooth on a slow one, the delay is
learned from the first key that is held. Any unknown key stops at once.
"""

from chefbotd.core.geometry import STANDING, Twist2D
from chefbotd.core.record import Record, replace

#: Which way each key drives, as signs of forward and of counter-clockwise turning: the page's keys, and the classic.
MOVES: dict[str, tuple[int, int]] = {
    "w": (1, 0),
    "a": (0, 1),
    "s": (-1, 0),
    "d": (0, -1),
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
    "+": (1.1, 1.1),
    "-": (0.9, 0.9),
    "r": (1.1, 1.0),
    "f": (0.9, 1.0),
    "y": (1.0, 1.1),
    "h": (1.0, 0.9),
}


ARM_KEY = "f2"
"""No key that is hit by habit: the letters beside the driving keys, Enter and Space never arm."""

#: How long a key counts as held, and how fast the robot may be asked to drive.
LONGEST_FIRST_HOLD_S, FIRST_HOLD_MARGIN_S = 0.8, 0.06
LONGEST_REPEAT_S, HOLD_INTERVALS = 0.12, 3.0
SHORTEST_HOLD_S, LONGEST_HOLD_S = 0.12, 0.25
MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S = 0.5, 5.0


class Keys(Record, frozen=True):
    """The state of the keys.

    ``held`` is the key that drives until ``until_s``, last seen at ``seen_s``; ``gap_s`` is the time between
    its last two arrivals as long as that may have been the keyboard's initial delay.
    """

    linear_m_s: float = 0.2
    angular_rad_s: float = 0.8
    first_hold_s: float = 0.6
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


def press(keys: Keys, key: str, now_s: float) -> Keys:
    """The state after a key: a motion begins or goes on, a speed changes, or (any other key) all stops."""
    if key in MOVES:
        return _move(keys, key, now_s)
    if key in SCALES:
        return _scale(keys, SCALES[key])
    return release_keys(keys)


def release_keys(keys: Keys) -> Keys:
    """The same speeds with no key held."""
    return replace(keys, held=None, gap_s=None)


def _scale(keys: Keys, factors: tuple[float, float]) -> Keys:
    return replace(
        keys,
        linear_m_s=min(keys.linear_m_s * factors[0], MAX_LINEAR_M_S),
        angular_rad_s=min(keys.angular_rad_s * factors[1], MAX_ANGULAR_RAD_S),
    )


def _move(keys: Keys, key: str, now_s: float) -> Keys:
    gap_s = now_s - keys.seen_s
    if key != keys.held or gap_s > LONGEST_FIRST_HOLD_S:
        return replace(keys, held=key, seen_s=now_s, until_s=now_s + keys.first_hold_s, gap_s=None)
    if gap_s > LONGEST_REPEAT_S:
        return replace(keys, seen_s=now_s, until_s=now_s + keys.first_hold_s, gap_s=gap_s)
    hold_s = min(max(HOLD_INTERVALS * gap_s, SHORTEST_HOLD_S), LONGEST_HOLD_S)
    return replace(_learn(keys), seen_s=now_s, until_s=now_s + hold_s, gap_s=None)


def _learn(keys: Keys) -> Keys:
    """Learn the initial delay: a quick repeat shows that the gap before it was that delay."""
    if keys.gap_s is None:
        return keys
    hold_s = min(keys.gap_s + FIRST_HOLD_MARGIN_S, LONGEST_FIRST_HOLD_S)
    return replace(keys, first_hold_s=hold_s)
