"""How far what a client has sent is looked through for stops once its connection ends: enough, and not without end.

Counted are the bytes, and the lines that look like a stop; no client that means to stop the robot sends so many.
"""

LAST_LOOK_S = 0.2
"""How long it is still read; what the kernel holds is there at once."""
LAST_LOOK_BYTES = 524_288
"""More than the kernel (twice ``backlog_bytes`` and a segment) and TLS (256 KiB) can hold."""
LAST_LOOK_LINES = 1000


class LastLook:
    """Over when it has seen too much, or is ended."""

    def __init__(self) -> None:
        self._bytes, self._lines, self._done = LAST_LOOK_BYTES, LAST_LOOK_LINES, set[str]()
        self.over = False

    def read(self, size: int) -> None:
        """So much more has come: what it asks for has not been done yet, even if the same was asked for before."""
        self._bytes -= size
        self._done.clear()
        self.over = self.over or self._bytes < 0

    def is_to_do(self, method: str | None) -> bool:
        """Whether a line that asks for this (None: for nothing that could be done) is to be carried out.

        Of several that have come together one is enough.
        """
        self._lines -= 1
        self.over = self.over or self._lines < 0
        if self.over or method is None or method in self._done:
            return False
        self._done.add(method)
        return True
