"""Since when nothing has come of which a map is made."""

from typing import Final

SILENT_S: Final = 2.0
"""After so long without scans, or without odometry, it is said."""

EXCUSED_S: Final = 1.0
"""Who has not looked for so long was busy, or asleep, and does not know what came meanwhile."""


class Silence:
    """What is missing, in words (``told``; empty: nothing). ``scan_s`` and ``odometry_s`` are when the last one came."""

    def __init__(self, lidar: str) -> None:
        self._lidar = lidar
        self.scan_s = self.odometry_s = float("-inf")
        self._awaited_s: float | None = None
        self._looked_s = float("-inf")
        self.told = ""

    def has_changed(self, now_s: float, *, is_awaited: bool) -> bool:
        """Look again: whether ``told`` is another one now, which it is once a second while something is missing."""
        if not is_awaited:
            self._awaited_s = None
        elif self._awaited_s is None or now_s - self._looked_s > EXCUSED_S:
            self._awaited_s = now_s
        self._looked_s, before = now_s, self.told
        self.told = "" if self._awaited_s is None else self._missing(now_s, self._awaited_s)
        return self.told != before

    def _missing(self, now_s: float, since_s: float) -> str:
        waited_s = {
            f"no scan of the lidar {self._lidar!r}": now_s - max(self.scan_s, since_s),
            "no odometry": now_s - max(self.odometry_s, since_s),
        }
        return "; ".join(f"{what} for {int(s)} s" for what, s in waited_s.items() if s >= SILENT_S)
