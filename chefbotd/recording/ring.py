"""The last minutes in memory, as chunks that are ready to be written."""

from collections import deque

from chefbotd.recording.chunk import Chunk


class Ring:
    """Chunks of the last ``seconds``, of ``most_bytes`` at most; the oldest give way."""

    def __init__(self, seconds: float, most_bytes: int) -> None:
        self._span_ns, self._most_bytes = round(seconds * 1e9), most_bytes
        self._chunks: deque[Chunk] = deque()
        self.size = 0

    def add(self, chunk: Chunk) -> None:
        """Add the newest one."""
        self._chunks.append(chunk)
        self.size += chunk.bytes_in_file
        oldest_ns = chunk.end_ns - self._span_ns
        while self._chunks and (self.size > self._most_bytes or self._chunks[0].end_ns < oldest_ns):
            self.size -= self._chunks.popleft().bytes_in_file

    @property
    def chunks(self) -> tuple[Chunk, ...]:
        """From the oldest to the newest."""
        return tuple(self._chunks)

    @property
    def seconds(self) -> float:
        """How far back it reaches."""
        return (self._chunks[-1].end_ns - self._chunks[0].start_ns) / 1e9 if self._chunks else 0.0
