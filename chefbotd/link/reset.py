"""Restarts the board on request: stops, waits until the robot stands, asks, and waits until the board is back.

The sketches put a command into force only when they have read all that waits, and wait a second before they restart. A
reset that follows its stop too closely leaves the motors on for that second. What the wheels still roll in it is counted
by nobody: the sketch prints nothing more, and its counters start anew.
"""

import math
from enum import StrEnum

from chefbotd.core.record import MutableState

STOP_S = 1.5
"""How long the robot's stop is waited for: the sketch may wait a second for an ultrasonic echo before it obeys."""

STANDS_S = 0.1
"""Wheels that have kept their counts for so long stand. Slower than 2 mm/s they lose less than a millimetre."""

PLAY_COUNTS = 3
"""An encoder at rest may dither by so many."""

BACK_S = 5.0
"""How long the board may take to be back; the published sketches take a second and their start."""


class ResetStage(StrEnum):
    """How far a restart has come; all but the first two are its end."""

    STOPPING = "stopping"
    ASKED = "asked"
    RESTARTED = "restarted"
    NOT_RESTARTED = "not_restarted"
    NO_ANSWER = "no_answer"
    LINK_LOST = "link_lost"


class ResetRequest(MutableState):
    """One restart at a time; ``stage`` is None while none is under way."""

    stage: ResetStage | None = None
    _since_s: float = -math.inf
    _zero_s: float | None = None
    _in_force: bool = False
    _stands: bool = False
    _kept: tuple[tuple[int, ...], float] | None = None

    def begin(self, now_s: float) -> None:
        """It was asked for, and a stop was written."""
        self.stage, self._since_s = ResetStage.STOPPING, now_s
        self._zero_s, self._in_force, self._stands, self._kept = None, False, False, None

    def end(self) -> None:
        """The board is back, or is not waited for any more."""
        self.stage = None

    def echoed(self, duty: tuple[float, ...], now_s: float) -> None:
        """The board says which command is in force; two readings, as the first may have been on its way already."""
        if self.stage is not ResetStage.STOPPING or any(duty):
            self._zero_s = None
        elif self._zero_s is None:
            self._zero_s = now_s
        elif now_s > self._zero_s:
            self._in_force = True

    def counted(self, counts: tuple[int, ...], now_s: float) -> None:
        """The encoders' counts: a wheel stands when it has kept its own for ``STANDS_S``."""
        if self._kept is None or _apart(self._kept[0], counts) > PLAY_COUNTS:
            self._kept = counts, now_s
        self._stands = now_s - self._kept[1] >= STANDS_S

    def may_ask(self, now_s: float) -> bool:
        """Whether the request may go: the stop is in force and the wheels stand, or the time for that is over."""
        stopped = self._in_force and self._stands
        return self.stage is ResetStage.STOPPING and (stopped or now_s - self._since_s >= STOP_S)

    def asked(self, now_s: float) -> None:
        """The request was written."""
        self.stage, self._since_s = ResetStage.ASKED, now_s

    def is_overdue(self, now_s: float) -> bool:
        """Whether the board should have been back by now."""
        return self.stage is ResetStage.ASKED and now_s - self._since_s >= BACK_S

    @property
    def look_again_s(self) -> float:
        """When to look again at the latest, by the clock of the stamps."""
        return self._since_s + (STOP_S if self.stage is ResetStage.STOPPING else BACK_S)


def _apart(before: tuple[int, ...], after: tuple[int, ...]) -> int:
    return max(abs(new - old) for old, new in zip(before, after, strict=True))
