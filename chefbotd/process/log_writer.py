"""A thread between the log and its stream, so that an unread stderr never blocks the robot."""

import atexit
import os
import queue
import threading

ROOM_FOR_LINES = 2000
LAST_WORDS_S = 0.5


class LogWriter:
    """A stream to write to that never blocks and never fails; what finds no room is counted and told later.

    The thread writes to the descriptor itself: at the interpreter's end nobody must wait for a stream's lock.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._texts: queue.Queue[str | None] = queue.Queue(ROOM_FOR_LINES)
        self._lost = 0
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    def write(self, text: str) -> None:
        """Take a line to be written as soon as the stream takes it."""
        try:
            self._texts.put_nowait(text)
        except queue.Full:
            self._lost += 1

    def flush(self) -> None:
        """Nothing to do: there is no buffer but the queue."""

    def close(self) -> None:
        """Let what waits be written, for ``LAST_WORDS_S`` at most."""
        atexit.unregister(self.close)
        try:
            self._texts.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(LAST_WORDS_S)

    def _run(self) -> None:
        while (text := self._texts.get()) is not None:
            lost, self._lost = self._lost, 0
            if lost:
                self._put(f'{{"event": "log lines lost, nobody reads them", "lines": {lost}}}\n')
            self._put(text)

    def _put(self, text: str) -> None:
        data = text.encode(errors="backslashreplace")
        try:
            while data:
                data = data[os.write(self._descriptor, data) :]
        except OSError:  # a closed pipe, a full disk: there is nowhere to complain
            self._lost += 1
