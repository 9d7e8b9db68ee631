"""The motor commands that the board may not have read yet.

A pseudo-terminal takes some 20 KB for a board that has stopped reading, a USB bridge whatever it is sent, and nothing
tells how much of it is unread (see docs/safety.md). The board itself does: its `s` lines echo the command in force, so
an echo that moves to a command proves that this one, and all before it, were read.
"""

from collections import deque

Duty = tuple[int, ...]

MOST_UNREAD = 10
"""More than a healthy board leaves unread in two cycles of 20 ms at 200 commands a second."""

LINE_LOST_S = 1.0
"""An echo that has not moved for so long may mean that the lines were lost on the wire: one more goes out."""


class UnreadCommands:
    """Decides which commands may follow those already written.

    A stop always may. Motion may while fewer than ``MOST_UNREAD`` commands are unread; beyond them only while the echo
    shows the newest in force, and one line every ``LINE_LOST_S``. So a steady command that the board confirms is
    repeated freely: whether repetitions are read cannot be told. Of a board whose echo has not followed any motion since
    the port was opened (it sends none, or one that means something else), whatever it says counts as proof.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The port is gone, and what it held with it."""
        self._unread: deque[Duty] = deque()
        self._newest: Duty | None = None
        self._echo: tuple[float, ...] | None = None
        self._echo_follows = False
        self._written_s = float("-inf")

    def admit(self, duty: Duty, now_s: float) -> bool:
        """Whether ``duty`` may be written now."""
        if len(self._unread) < MOST_UNREAD or not any(duty):
            return True
        return self._echo == self._newest or now_s - self._written_s >= LINE_LOST_S

    def note(self, duty: Duty, now_s: float) -> None:
        """``duty`` was written; stops in a row count once, and what is kept is bounded."""
        if duty != self._newest or (any(duty) and len(self._unread) < MOST_UNREAD):
            self._unread.append(duty)
        self._newest, self._written_s = duty, now_s

    def heard(self) -> None:
        """The board said something."""
        if not self._echo_follows:
            self._unread.clear()

    def echoed(self, duty: tuple[float, ...]) -> None:
        """The board says which command is in force: if that is another one than before, it has been reading."""
        moved, self._echo = duty != self._echo, duty
        if any(duty) and (duty == self._newest or duty in self._unread):
            self._echo_follows = True
        while moved and self._unread:
            if self._unread.popleft() == duty:
                return
