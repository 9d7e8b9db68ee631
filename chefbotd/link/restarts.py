"""The board's restarts: the requested ones, from the stop until the board is back, and the unexpected ones."""

import math
from collections.abc import Callable
from enum import StrEnum

import structlog
from msgspec import field

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import BoardResetProgressed, BoardRestarted
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import ResumableTimer, inputs_of
from chefbotd.link.board_writer import BoardWriter
from chefbotd.link.restart_watch import RestartWatch

# Restarts the board on request: stops, waits until the robot stands, asks, and waits until the board is back.
#
# The sketches put a command into force only when they have read all that waits, and wait a second before they restart.
# A reset that follows its stop too closely leaves the motors on for that second. What the wheels still roll in it is
# counted by nobody: the sketch prints nothing more, and its counters start anew.

STOP_S = 1.5
"""How long the robot's stop is waited for: the sketch may wait a second for an ultrasonic echo before it obeys."""

STANDS_S = 0.1
"""Wheels whose counts stay the same for this long stand. Slower than 2 mm/s they lose less than a millimetre."""

PLAY_COUNTS = 3
"""An encoder at rest may dither by this many counts."""

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


log = structlog.get_logger(component="link")

REASONS = {
    ResetStage.STOPPING: Sentence(
        "board.reset_stopping", "waiting until the board confirms the stop and the wheels stand still"
    ),
    ResetStage.ASKED: Sentence("board.reset_asked", "the board was told to restart"),
    ResetStage.RESTARTED: Sentence("board.reset_done", "the board has restarted; arm the robot to move it"),
    ResetStage.NOT_RESTARTED: (
        Sentence(
            "board.reset_not",
            "the board answered 'Reset Done' and went on without a restart, as the sketch for the Arduino does: "
            "nothing was lost and the robot may be driven; to restart it, press its button or pull its cable",
        )
    ),
    ResetStage.NO_ANSWER: (
        Sentence(
            "board.reset_no_answer",
            "the board has not restarted: the robot may be driven if the board still sends data; otherwise press "
            "its button or pull its cable",
        )
    ),
    ResetStage.LINK_LOST: Sentence("board.reset_link_lost", "the link was lost before the board was back"),
}
LOOK_AGAIN_S = 0.05
"""A port that does not take the request yet is tried again so soon."""

ENDS_WELL = (ResetStage.STOPPING, ResetStage.ASKED, ResetStage.RESTARTED)


TIMER = "board restart"


class RestartsState(MutableState):
    """What is known of the board's restarts; ``due_s`` is when the request is looked at again."""

    watch: RestartWatch = field(default_factory=RestartWatch)
    reset: ResetRequest = field(default_factory=ResetRequest)
    due_s: float | None = None
    count: int = 0


class Restarts(StatefulPart[RestartsState]):
    """Publishes ``BoardRestarted`` and ``BoardResetProgressed``; ``request`` makes the line that asks for a restart."""

    def __init__(self, bus: Bus, clock: Clock, speech: BoardWriter, request: Callable[[], bytes]) -> None:
        self._bus, self._clock, self._writer, self._request_line = bus, inputs_of(clock), speech, request
        self._timer = ResumableTimer(self._clock, self._look_at_reset, TIMER)
        self.memory, self.parts = RestartsState(), {"due_s": self._timer}

    @property
    def holds_motion(self) -> bool:
        """Whether a restart is under way, so that nothing but a stop may be sent."""
        return self.memory.reset.stage is not None

    def begin(self) -> None:
        """Begin a restart, after its stop was sent; a restart that is under way goes on."""
        if self.memory.reset.stage is None:
            self.memory.reset.begin(self._clock.now_s())
            self._report_stage(ResetStage.STOPPING)
            self._look_at_reset()

    def link_lost(self) -> None:
        """The board that was to restart is gone."""
        self._end_reset(ResetStage.LINK_LOST)

    def echoed(self, duty: tuple[float, ...], now_s: float) -> None:
        """The board said which command is in force."""
        if self.memory.reset.stage is ResetStage.STOPPING:
            self.memory.reset.echoed(duty, now_s)
            self._look_at_reset()

    def turned(self, counts: tuple[int, ...], now_s: float) -> None:
        """The board said how far its wheels have turned."""
        if self.memory.reset.stage is ResetStage.STOPPING:
            self.memory.reset.counted(counts, now_s)
            self._look_at_reset()

    def reset_done(self, now_s: float) -> None:
        """The board said that it is about to restart."""
        self.memory.watch.reset_done(now_s)

    def counted(self, now_s: float, counts: tuple[int, ...], *, has_clock: bool) -> str | None:
        """An encoder line came: how it shows that the board has restarted (``noticed`` is to follow); None if not."""
        cause = self.memory.watch.observe(now_s, counts, has_clock=has_clock)
        if cause is None and self.memory.watch.has_gone_on:
            self.memory.watch.has_gone_on = False
            if self.memory.reset.stage is ResetStage.ASKED:
                self._end_reset(ResetStage.NOT_RESTARTED)
            else:
                log.warning("the board sent 'Reset Done' without being asked, and continued")
        return cause

    def noticed(self, now_s: float, cause: str) -> None:
        """The board has restarted."""
        self.memory.count += 1
        self.memory.watch.restarted()
        self._bus.publish(BoardRestarted(now_s, cause))
        self._end_reset(ResetStage.RESTARTED)

    def _look_at_reset(self) -> None:
        """Ask as soon as the robot stands and the port accepts it; give up if the board is not back in time."""
        self._timer.cancel()
        now_s = self._clock.now_s()
        if self.memory.reset.is_overdue(now_s):
            self._end_reset(ResetStage.NO_ANSWER)
            return
        if self.memory.reset.may_ask(now_s) and self._writer.has_drained():
            self._writer.write(self._request_line(), now_s)
            self.memory.reset.asked(now_s)
            self._report_stage(ResetStage.ASKED)
        wait_s = max(self.memory.reset.look_again_s - now_s, LOOK_AGAIN_S)
        self._timer.start(wait_s)

    def _end_reset(self, stage: ResetStage) -> None:
        self._timer.cancel()
        if self.memory.reset.stage is not None:
            self.memory.reset.end()
            self._report_stage(stage)

    def _report_stage(self, stage: ResetStage) -> None:
        self._bus.publish(BoardResetProgressed(self._clock.now_s(), str(stage), REASONS[stage]))
        logged = log.info if stage in ENDS_WELL else log.warning
        logged("restart of the board", stage=str(stage), reason=REASONS[stage])
