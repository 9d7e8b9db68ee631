"""Which nodes the robot has found a way to lately.

A plan waits for the next turn of the robot's worker, 50 ms. The nodes of a fleet are always the same, so most plans need
not be made anew before an order is taken: the way is planned in any case when the robot drives there.
"""

from typing import Final

from chefbot_vda5050.messages import NodePosition

KNOWN_FOR_S: Final = 600.0
MOST: Final = 1000

Key = tuple[str, float, float, float | None, float | None]


class KnownWays:
    """Nodes by their map, position, heading and tolerance; times are in seconds of any steady clock."""

    def __init__(self) -> None:
        self._until_s: dict[Key, float] = {}

    def has(self, position: NodePosition, now_s: float) -> bool:
        """Whether there was a way to it not long ago."""
        return self._until_s.get(_key(position), -1.0) >= now_s

    def add(self, position: NodePosition, now_s: float) -> None:
        """There is one now; of too many the oldest is forgotten."""
        self._until_s.pop(_key(position), None)
        self._until_s[_key(position)] = now_s + KNOWN_FOR_S
        if len(self._until_s) > MOST:
            del self._until_s[next(iter(self._until_s))]

    def clear(self) -> None:
        """Something has changed: no way is known any more."""
        self._until_s.clear()


def _key(position: NodePosition) -> Key:
    return (position.map_id, position.x, position.y, position.theta, position.allowed_deviation_xy)
