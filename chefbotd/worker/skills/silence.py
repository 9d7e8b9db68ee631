"""Measures how long the inputs of mapping have been silent."""

from collections.abc import Sequence
from typing import Final

SILENT_S: Final = 2.0
"""After so long without scans, or without odometry, it is said."""

EXCUSED_S: Final = 1.0
"""Who has not looked for so long was busy, or asleep, and does not know what came meanwhile."""


class Silence:
    """What is missing, in words (``problem``; empty: nothing). ``scan_s`` and ``odometry_s`` are when the last one came.

    Each lidar is named by itself. ``leaves_nothing``: not one of them is left, or no odometry.
    """

    def __init__(self, lidars: Sequence[str]) -> None:
        self.scan_s = dict.fromkeys(lidars, float("-inf"))
        self.odometry_s = float("-inf")
        self._awaited_s: float | None = None
        self._looked_s = float("-inf")
        self.problem = ""
        self.leaves_nothing = False

    def has_changed(self, now_s: float, *, is_awaited: bool) -> bool:
        """Look again: whether ``problem`` is another one now, which it is once a second while something is missing."""
        if not is_awaited:
            self._awaited_s = None
        elif self._awaited_s is None or now_s - self._looked_s > EXCUSED_S:
            self._awaited_s = now_s
        self._looked_s, before = now_s, self.problem
        self.leaves_nothing = False
        self.problem = "" if self._awaited_s is None else self._missing(now_s, self._awaited_s)
        return self.problem != before

    def _missing(self, now_s: float, since_s: float) -> str:
        heard_s = max(self.scan_s.values(), default=since_s)
        self.leaves_nothing = now_s - max(min(heard_s, self.odometry_s), since_s) >= SILENT_S
        waited_s = {
            **{
                f"no scan of the lidar {name!r}": now_s - max(at_s, since_s)
                for name, at_s in self.scan_s.items()
            },
            "no odometry": now_s - max(self.odometry_s, since_s),
        }
        return "; ".join(f"{what} for {int(s)} s" for what, s in waited_s.items() if s >= SILENT_S)
