"""The timer that runs the control loop without encoder frames: every few milliseconds, more rarely at rest.

Each encoder frame restarts the timer. A robot is at rest once its readings have shown no motion for a while, without a
duty or a command. Then time alone changes nothing: silent encoders matter only while the robot is driven, and every
command acts in the call that brings it.
"""

import math
from collections.abc import Callable

from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.inputs import InputLog, Timer, due_of

REST_AFTER_S = 1.0
"""The time without motion until the robot is at rest. Every frame in it was answered with a stop."""

JUST = 1e-6
LOOKS_PER_PATIENCE = 2
"""How often a loop at rest acts within the watchdog's time-out."""

DRIVE_WATCH = "drive watch"
"""The timer's name in a recording."""


class WatchTimerState(MutableState):
    """The time of the next look, the begin of the wait for it, and whether the robot is at rest."""

    due_s: float | None = None
    began_s: float = 0.0
    still_since_s: float | None = None
    runs: bool = False
    resting: bool = False


class WatchTimer(StatefulPart[WatchTimerState]):
    """Calls ``look`` when nothing was received for ``period_s``, and again until something is.

    At rest it does so a few times in ``patience_s``, the watchdog's time-out. ``still_since_s`` is when motion and
    commands ended (None: they have not).
    """

    def __init__(
        self, entries: InputLog, period_s: float, patience_s: float, look: Callable[[], None]
    ) -> None:
        self._entries, self._look = entries, look
        self._timer: Timer | None = None
        self.memory = WatchTimerState()
        self._period_s = period_s
        self._rest_period_s = period_s * max(1, math.floor(patience_s / LOOKS_PER_PATIENCE / period_s))

    def state(self) -> WatchTimerState:
        """Return the state of this part."""
        self.memory.due_s = due_of(self._timer)
        return self.memory

    def restore(self, state: WatchTimerState) -> None:
        """Restore this state."""
        super().restore(state)
        self._timer = self._entries.resume(state.due_s, self._look, DRIVE_WATCH)

    def start(self, now_s: float) -> None:
        """Start the timer."""
        self.memory.runs = True
        self.restart(now_s)

    def stop(self) -> None:
        """Stop the timer."""
        self.memory.runs = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def restart(self, now_s: float) -> None:
        """Wait for a whole period from now, after a reading or a look."""
        if self.memory.runs:
            if self._timer is not None:
                self._timer.cancel()
            self.memory.began_s = now_s
            delay_s = self._rest_period_s if self.memory.resting else self._period_s
            self._timer = self._entries.call_later(delay_s, self._look, DRIVE_WATCH)

    def note_stillness(self, now_s: float) -> None:
        """Note a good reading without motion, duty or command."""
        if self.memory.still_since_s is None:
            self.memory.still_since_s = now_s
        elif not self.memory.resting and now_s - self.memory.still_since_s >= REST_AFTER_S:
            self.memory.resting = True

    def note_activity(self, now_s: float) -> None:
        """Note any activity: the next look comes when it would have come without the rest."""
        self.memory.still_since_s = None
        if self.memory.resting:
            self.memory.resting = False
            self.look_soon()

    def look_soon(self) -> None:
        """Look as soon as for a robot that is not at rest, for example because a fault is due."""
        if self._timer is None:
            return
        gone_s = self._entries.now_s() - self.memory.began_s
        looks = max(1, math.ceil(gone_s / self._period_s - JUST))
        self._timer.cancel()
        delay_s = max(0.0, looks * self._period_s - gone_s)
        self._timer = self._entries.call_later(delay_s, self._look, DRIVE_WATCH)
