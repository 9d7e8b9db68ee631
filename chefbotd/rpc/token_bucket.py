"""A token bucket (Turner 1986): limits a long-run rate and the size of a burst."""


class TokenBucket:
    """Holds up to ``size`` tokens and is full at first; ``per_s`` tokens are added each second."""

    def __init__(self, per_s: float, size: float, now_s: float) -> None:
        self._per_s, self._size = per_s, size
        self._level, self._stamp_s = size, now_s

    def take_token(self, now_s: float) -> bool:
        """Take one token; False when there is none."""
        self._level = min(self._size, self._level + (now_s - self._stamp_s) * self._per_s)
        self._stamp_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True
