"""What a lidar's session asks of the reader of its wire."""

from collections import Counter
from typing import Protocol

from chefbotd.link.lidar.turn import Turn


class LidarReader(Protocol):
    """One side of a lidar's wire, without I/O; it lives across reconnections and keeps its counters.

    ``packets`` counts what the lidar says in good form, ``refused`` what was passed over, by reason. ``complaint`` is
    what the lidar itself says is wrong, or what it is instead of the configured one (empty: nothing).
    """

    @property
    def packets(self) -> int:
        """How many packets were in good form."""
        ...

    @property
    def complaint(self) -> str:
        """What is wrong, for people."""
        ...

    @property
    def refused(self) -> Counter[str]:
        """How much was passed over, by reason."""
        ...

    @property
    def awaits_scan(self) -> bool:
        """Whether the device has answered, was asked for a scan, and has sent nothing of it yet."""
        ...

    def begin(self, now_s: float) -> bytes:
        """The port was opened: what is to be written."""
        ...

    def read_bytes(self, data: bytes, now_s: float) -> list[Turn]:
        """Bytes that have come in: the turns that they complete."""
        ...

    def poll(self, now_s: float) -> bytes:
        """What is to be written now; to be asked after each ``read_bytes``, and a few times a second."""
        ...

    def end(self) -> bytes:
        """The last words before the port is closed."""
        ...
