"""Decides which motor commands may follow unread ones, by the board's buffer and its echo.

A board that does not read loses what its receive buffer cannot hold, and the published sketch obeys the pieces that are
left. So what it may not have read is counted in bytes. It has read what was written before its last whole cycle, and
what its `s` line says is in force. And a board whose echo no longer follows is told nothing that makes a wheel faster.
"""

import math
from collections.abc import Callable

from msgspec import Struct

from chefbotd.core.record import MutableState, StatefulPart
from firmware_protocol.checked import SEAL_BYTES

Duty = tuple[int, ...]

STUCK_CYCLES = 3
STUCK_S = 0.2
"""An echo that does not show a command for this many cycles and this long is lost or stuck."""

LINE_LOST_S = 1.0
"""Meanwhile the last command is repeated so often, as it may have been lost on the wire."""

STOP_AGAIN_S = 0.1

MOST_UNCONFIRMED = 64

CHECKED_ROOM_BYTES = 127
"""The receive ring of our own firmware, which reads all the time."""

FEED_S = 0.04
"""In the checked mode the duty in force is repeated so often, whatever is known of the board: its dead-man needs it."""


def slows(duty: Duty, before: Duty) -> bool:
    """Whether no wheel gets a larger duty than before, or one of the other sign."""
    for new, old in zip(duty, before, strict=True):  # noqa: SIM110 (a generator takes three times as long)
        if not (0 <= new <= old or old <= new <= 0):
            return False
    return True


class _Line(Struct, gc=False):
    duty: Duty | None
    size: int
    written_s: float


class WindowState(MutableState):
    """The written commands that the board has not read or confirmed, and the board's echo."""

    newest: Duty
    written_s: float = -math.inf
    unread: list[_Line] = []
    unconfirmed: list[tuple[Duty, int, float]] = []
    echo: tuple[float, ...] | None = None
    echo_follows: bool = False
    cycles: int = 0
    cycle_s: float = -math.inf


class SendWindow(StatefulPart[WindowState]):
    """``room_bytes`` is the board's receive buffer, ``size_of`` a command's length on the wire with its end.

    A stop may always go: whatever pieces of it are left say zero. It keeps the room of two, and a command that slows the
    room of one more. One that repeats the last waits until there is room for a change beside it; a stop that does
    goes as soon as the buffer is nearly empty, and every ``STOP_AGAIN_S``. ``newest`` in its memory is the last command
    that was written; a stop before the first. While it ``is_checked``, each command is longer by its seal, and the board
    is our own firmware, which never waits.
    """

    def __init__(self, room_bytes: int, wheels: int, size_of: Callable[[Duty], int]) -> None:
        self._size_of, self._room_bytes = size_of, room_bytes
        self._still = (0,) * wheels
        self._stop_room = 2 * size_of(self._still)
        self._classic_room_bytes = room_bytes
        self.is_checked, self._seal_bytes = False, 0
        self.memory = WindowState(self._still)
        self.unread_bytes = 0  # of the board's buffer: what may be in use

    def set_mode(self, *, is_checked: bool) -> None:
        """Commands are sealed from now on, or not any more."""
        self.is_checked = is_checked
        self._seal_bytes = SEAL_BYTES if is_checked else 0
        self._room_bytes = CHECKED_ROOM_BYTES if is_checked else self._classic_room_bytes

    def forget(self) -> None:
        """The port is gone, and what it held with it."""
        self.memory, self.unread_bytes = WindowState(self._still), 0

    def restarted(self) -> None:
        """The board restarted: its buffer is empty, and its motors stand."""
        before = self.memory
        self.memory = WindowState(self._still, echo=before.echo, echo_follows=before.echo_follows)
        self.unread_bytes = 0

    def restore(self, state: WindowState) -> None:
        """Restore this state."""
        super().restore(state)
        self.unread_bytes = sum(line.size for line in state.unread)

    def admit(self, duty: Duty, now_s: float) -> bool:
        """Whether ``duty`` may be written now."""
        memory, newest = self.memory, self.memory.newest
        if not any(duty):
            crowded = 4 * (self.unread_bytes + self._size_of(duty)) > self._room_bytes
            return duty != newest or not crowded or now_s - memory.written_s >= STOP_AGAIN_S
        if self.is_checked and duty == newest and now_s - memory.written_s >= FEED_S:
            return True
        if self.echo_is_stuck(now_s):
            if not slows(duty, newest):
                return False
            if duty == newest:
                return now_s - memory.written_s >= LINE_LOST_S
        if not self.unread_bytes:
            return True
        size = self._size_of(duty) + self._seal_bytes
        changes = 2 if duty == newest else 0 if slows(duty, newest) else 1
        return self.unread_bytes + size + changes * size + self._stop_room <= self._room_bytes

    def echo_is_stuck(self, now_s: float) -> bool:
        """Whether the board goes on and its echo, which has followed before, does not show what was written."""
        memory = self.memory
        if not (memory.unconfirmed and memory.echo_follows):
            return False
        _, cycles, written_s = memory.unconfirmed[0]
        return memory.cycles - cycles >= STUCK_CYCLES and now_s - written_s >= STUCK_S

    def complaint(self, now_s: float) -> str:
        """What is wrong with the echo, for people; nothing while it follows."""
        if not self.echo_is_stuck(now_s):
            return ""
        return (
            f"the board reports duty {self.memory.echo}, but {self.memory.newest} was sent: commands that speed a "
            "wheel up are held back until both agree; does the board receive what it is sent?"
        )

    def note(self, duty: Duty, now_s: float, times: int = 1) -> None:
        """``duty`` was written so many times; what is kept is bounded by the buffer."""
        memory, size = self.memory, times * (self._size_of(duty) + self._seal_bytes)
        if self.unread_bytes + size > self._room_bytes and memory.unread:
            memory.unread[-1].written_s = now_s  # a stop that may not fit: the buffer holds no more
        else:
            memory.unread.append(_Line(duty, size, now_s))
            self.unread_bytes += size
        if duty != memory.newest and len(memory.unconfirmed) < MOST_UNCONFIRMED:
            memory.unconfirmed.append((duty, memory.cycles, now_s))
        memory.newest, memory.written_s = duty, now_s

    def note_other(self, size: int, now_s: float) -> None:
        """A line that is no motor command was written, for which there was room."""
        self.memory.unread.append(_Line(None, size, now_s))
        self.unread_bytes += size

    def has_room(self, size: int) -> bool:
        """Whether a line that is no motor command fits beside what is unread and two stops."""
        return self.unread_bytes + size + self._stop_room <= self._room_bytes

    def all_read(self) -> None:
        """The board has said that it has read everything."""
        self.memory.unread.clear()
        self.unread_bytes = 0

    def cycle(self, now_s: float) -> None:
        """A line came that the board prints once in every cycle: what was written before the last one has been read."""
        memory = self.memory
        before_s, unread = memory.cycle_s, memory.unread
        if now_s == before_s:  # in the same read, nobody knows when it was printed
            return
        while unread and unread[0].written_s <= before_s:
            self.unread_bytes -= unread.pop(0).size
        memory.cycles += 1
        memory.cycle_s = now_s

    def echoed(self, duty: tuple[float, ...]) -> None:
        """The board says which command is in force: if that is another one than before, it has read up to that."""
        memory = self.memory
        moved, memory.echo = duty != memory.echo, duty
        if duty == memory.newest:
            confirmed = True
            memory.unconfirmed.clear()
        else:
            confirmed = self._confirm(duty, moved)
        if confirmed and not memory.echo_follows and any(duty):
            memory.echo_follows = True
        if moved:
            self._drop_through(duty)

    def _confirm(self, duty: tuple[float, ...], moved: bool) -> bool:
        """Handle an echo of an older command: drop what it confirms. Returns whether it was expected."""
        for count, (waiting, _, _) in enumerate(self.memory.unconfirmed, 1):
            if waiting == duty:
                for _ in range(count):
                    self.memory.unconfirmed.pop(0)
                return True
        if moved:
            self.memory.unconfirmed.clear()
        return False

    def _drop_through(self, duty: tuple[float, ...]) -> None:
        """The board has read all that was written up to this command, if it is among what may be unread."""
        for count, line in enumerate(self.memory.unread, 1):
            if line.duty == duty:
                for _ in range(count):
                    self.unread_bytes -= self.memory.unread.pop(0).size
                return
