"""Holds at most one waiting motor command. A newer one replaces it, and a stale one that is faster is never sent.

The firmware has no watchdog, so a queue of velocities behind a slow reader would be driven long after it was meant.
"""

import asyncio
from collections.abc import Callable

from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.inputs import Timer, due_of
from chefbotd.link.send_window import Duty, SendWindow, slows

STALE_S = 0.3
"""A command that was held back for longer is dropped: whoever asked for it has asked again, or is not there any more.

One that slows is kept: without it, the faster one would stay in force.
"""


def _nothing() -> None:
    """Nobody wants to know."""


class SetpointState(MutableState):
    """What waits and what was written; the lines written so far use up the time until ``paid_s``.

    ``due_s`` is when a timer is to send what waits.
    """

    pending: Duty | None = None
    written: Duty | None = None
    paid_s: float = float("-inf")
    due_s: float | None = None
    withdrawn: bool = False
    replaced: int = 0
    offered_s: float = float("-inf")


class SetpointWriter(StatefulPart[SetpointState]):
    """Writes duties at most every ``interval_s`` on the whole, two of them close together; a stop goes out at once.

    Two, because a command and the answer to an encoder frame may fall together, and neither is to wait for the other.

    ``write`` puts one command on the wire at a time, before what is unsent if it is told so. ``idle`` tells whether the
    transport has nothing left to send: a command that makes a wheel faster waits for that, one that slows goes instead
    of what is unsent. ``window`` says what the board can take. Call ``resume`` when the transport has drained, or the
    board has spoken. ``call_later`` is the event loop's where none is given. ``on_withdrawn`` is
    called, in the loop, when a thread has withdrawn what waited.
    """

    def __init__(
        self,
        write: Callable[[Duty, float, bool], None],
        idle: Callable[[], bool],
        now_s: Callable[[], float],
        interval_s: float,
        window: SendWindow,
        call_later: Callable[[float, Callable[[], None]], Timer] | None = None,
        on_withdrawn: Callable[[], None] = _nothing,
    ) -> None:
        self._write, self._idle, self._now_s, self._interval_s = write, idle, now_s, interval_s
        self.memory = SetpointState()
        self._timer: Timer | None = None
        self._call_later = call_later or _on_the_loop
        self._window = window
        self._on_withdrawn = on_withdrawn

    def state(self) -> SetpointState:
        """Return the state of this part."""
        self.memory.due_s = due_of(self._timer)
        return self.memory

    def restore(self, state: SetpointState) -> None:
        """Restore this state."""
        super().restore(state)
        self._timer = None
        if state.due_s is not None:
            self._wake_in(state.due_s - self._now_s())

    @property
    def replaced(self) -> int:
        """How many commands gave way to a newer one before they were sent."""
        return self.memory.replaced

    def ceiling(self, now_s: float) -> Duty | None:
        """What was last written, while something waits that is faster, or would; None while nothing is held back."""
        if self.memory.withdrawn:
            self._note_withdrawn()
        waits = self.memory.pending is not None and self._timer is None
        return self._window.memory.newest if waits or self._window.echo_is_stuck(now_s) else None

    def offer(self, duty: Duty) -> None:
        """Send ``duty`` now if the interval allows it, else as soon as it does, unless a newer one comes first."""
        memory, now_s = self.memory, self._now_s()
        if memory.withdrawn:
            self._note_withdrawn()
        if memory.pending not in (None, duty):
            memory.replaced += 1
        memory.pending, memory.offered_s = duty, now_s
        wait_s = memory.paid_s - self._interval_s - now_s
        if wait_s > 0 and not self._ends_motion(duty):
            self._wake_in(wait_s)
        else:
            self._send_setpoint(now_s)

    def resume(self) -> None:
        """Send what waits, if nothing holds it back."""
        self._send_setpoint(self._now_s())

    def _send_setpoint(self, now_s: float) -> None:
        memory = self.memory
        if memory.withdrawn:
            self._note_withdrawn()
        if self._timer is not None:
            self._cancel_timer()
        duty, idle = memory.pending, self._idle()  # another thread may withdraw what waits at any moment
        if duty is None or not (idle or self._overtakes(duty)):
            return
        if now_s - memory.offered_s > STALE_S and any(duty) and not self._overtakes(duty):
            memory.pending = None
            return
        if not self._window.admit(duty, now_s):
            if duty == self._window.memory.newest:  # it was said already
                memory.pending = None
            return
        memory.pending, memory.written = None, duty
        memory.paid_s = (memory.paid_s if memory.paid_s > now_s else now_s) + self._interval_s
        self._write(duty, now_s, not idle)

    def heard(self) -> None:
        """The board said something: what it had to wait for may go."""
        if self.memory.pending is not None and self._timer is None:
            self.resume()

    def withdraw(self) -> None:
        """Drop what waits; may be called from any thread."""
        self.memory.pending, self.memory.withdrawn = None, True

    def _note_withdrawn(self) -> None:
        self.memory.withdrawn = False
        self._on_withdrawn()

    def forget(self) -> None:
        """Drop what waits: the link it was meant for is gone."""
        self._cancel_timer()
        self.memory.pending = self.memory.written = None

    def _overtakes(self, duty: Duty) -> bool:
        """Whether this slows what was written last, so that it must not wait behind that."""
        if not any(duty):
            return self._ends_motion(duty)
        return (
            self.memory.written is not None
            and duty != self.memory.written
            and slows(duty, self.memory.written)
        )

    def _ends_motion(self, duty: Duty) -> bool:
        """Whether this is a stop, and the last that was written none: it waits for nothing."""
        return not any(duty) and (self.memory.written is None or any(self.memory.written))

    def _wake_in(self, wait_s: float) -> None:
        if self._timer is None:
            self._timer = self._call_later(wait_s, self.resume)

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _on_the_loop(delay_s: float, callback: Callable[[], None]) -> Timer:
    return asyncio.get_running_loop().call_later(delay_s, callback)
