"""A token bucket (Turner 1986): so many a second in the long run, so many at once."""


class TokenBucket:
    """Holds up to ``size`` drops and is full at first; ``per_s`` drops flow in."""

    def __init__(self, per_s: float, size: float, now_s: float) -> None:
        self._per_s, self._size = per_s, size
        self._level, self._stamp_s = size, now_s

    def take(self, now_s: float) -> bool:
        """Take one out; False, and nothing taken, when there is none."""
        self._level = min(self._size, self._level + (now_s - self._stamp_s) * self._per_s)
        self._stamp_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True
