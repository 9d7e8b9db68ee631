"""A restart of the board on request: stop, see that the stop is in force, ask, and wait until the board is back.

The sketches put a command into force only when they have read all that waits, and wait a second before they restart. A
reset that follows its stop too closely leaves the motors on for that second.
"""

from enum import StrEnum

STOP_S = 1.5
"""How long the echo of the stop is waited for: the sketch may wait a second for an ultrasonic echo first."""

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


class ResetRequest:
    """One restart at a time; ``stage`` is None while none is under way."""

    def __init__(self) -> None:
        self.stage: ResetStage | None = None
        self._since_s = float("-inf")
        self._zero_s: float | None = None
        self._in_force = False

    def begin(self, now_s: float) -> None:
        """It was asked for, and a stop was written."""
        self.stage, self._since_s = ResetStage.STOPPING, now_s
        self._zero_s, self._in_force = None, False

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

    def may_ask(self, now_s: float) -> bool:
        """Whether the request may go: the stop is in force, or nobody tells."""
        return self.stage is ResetStage.STOPPING and (self._in_force or now_s - self._since_s >= STOP_S)

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
