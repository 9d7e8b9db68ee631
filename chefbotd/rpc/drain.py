"""How much of what a client has sent is searched for stops once its connection ends: all that can matter, but bounded.

Bytes are counted, and lines that look like a stop. No client that means to stop the robot sends so many.
"""

DRAIN_S = 0.2
"""For how long a connection that ends is still read; what the kernel holds is there at once."""
DRAIN_BYTES = 524_288
"""More than the kernel (twice ``backlog_bytes`` and a segment) and TLS (256 KiB) can hold."""
DRAIN_LINES = 1000


class DrainLimit:
    """``exceeded`` once too much was read, or when the draining is to end early."""

    def __init__(self) -> None:
        self._bytes, self._lines, self._served = DRAIN_BYTES, DRAIN_LINES, set[str]()
        self.exceeded = False

    def count_bytes(self, size: int) -> None:
        """Count bytes that were read; a method that was served before may be served once more."""
        self._bytes -= size
        self._served.clear()
        self.exceeded = self.exceeded or self._bytes < 0

    def admit_line(self, method: str | None) -> bool:
        """Whether to serve a line that asks for an urgent method; None: it only looked like one.

        Of several lines with the same method that arrived together, one is enough.
        """
        self._lines -= 1
        self.exceeded = self.exceeded or self._lines < 0
        if self.exceeded or method is None or method in self._served:
            return False
        self._served.add(method)
        return True
