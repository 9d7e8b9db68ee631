"""What a host reads first that opens the port while the board is sending: the end of a line."""

from collections.abc import Callable


class FirstLineCut:
    """Passes on what the board sends; of the first line that each new host would hear, only the second half.

    ``host`` gives the one that has the port open, None if nobody has.
    """

    def __init__(self, send: Callable[[bytes], None], host: Callable[[], object | None]) -> None:
        self._send, self._host = send, host
        self._heard_by: object | None = None

    def __call__(self, data: bytes) -> None:
        """One or more whole lines."""
        host = self._host()
        if host is not None and host is not self._heard_by:
            data = data[(data.find(b"\n") + 1) // 2 :]
        self._heard_by = host
        self._send(data)
