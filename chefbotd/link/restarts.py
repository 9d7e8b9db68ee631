"""The board's restarts: the requested ones, from the stop until the board is back, and the unexpected ones."""

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import BoardResetProgressed, BoardRestarted
from chefbotd.core.record import Record
from chefbotd.entries import Timer, due_of, entries_of
from chefbotd.link.board_writer import BoardWriter
from chefbotd.link.reset import ResetRequest, ResetStage
from chefbotd.link.restart_watch import RestartWatch

log = structlog.get_logger(component="link")

REASONS = {
    ResetStage.STOPPING: "waiting until the board confirms the stop and the wheels stand still",
    ResetStage.ASKED: "the board was told to restart",
    ResetStage.RESTARTED: "the board has restarted; arm the robot to move it",
    ResetStage.NOT_RESTARTED: (
        "the board answered 'Reset Done' and went on without a restart, as the sketch for the Arduino does: "
        "nothing was lost and the robot may be driven; to restart it, press its button or pull its cable"
    ),
    ResetStage.NO_ANSWER: (
        "the board has not restarted: the robot may be driven if the board still sends data; otherwise press its button "
        "or pull its cable"
    ),
    ResetStage.LINK_LOST: "the link was lost before the board was back",
}
LOOK_AGAIN_S = 0.05
"""A port that does not take the request yet is tried again so soon."""

ENDS_WELL = (ResetStage.STOPPING, ResetStage.ASKED, ResetStage.RESTARTED)


TIMER = "board restart"


class RestartsState(Record, frozen=True):
    """What is known of the board's restarts; ``due_s`` is when the request is looked at again."""

    watch: RestartWatch
    reset: ResetRequest
    due_s: float | None
    count: int


class Restarts:
    """Publishes ``BoardRestarted`` and ``BoardResetProgressed``; ``request`` is the line that asks for a restart."""

    def __init__(self, bus: Bus, clock: Clock, speech: BoardWriter, request: bytes) -> None:
        self._bus, self._clock, self._writer, self._request_line = bus, entries_of(clock), speech, request
        self._watch, self._reset = RestartWatch(), ResetRequest()
        self._timer: Timer | None = None
        self.count = 0

    def state(self) -> RestartsState:
        """Return the state of this part."""
        return RestartsState(self._watch, self._reset, due_of(self._timer), self.count)

    def restore(self, state: RestartsState) -> None:
        """Restore this state."""
        self._watch, self._reset, self.count = state.watch, state.reset, state.count
        self._timer = self._clock.resume(state.due_s, self._look, TIMER)

    @property
    def holds_motion(self) -> bool:
        """Whether a restart is under way, so that nothing but a stop may be sent."""
        return self._reset.stage is not None

    def begin(self) -> None:
        """A restart is asked for, and the stop before it was sent. One that is under way already goes on."""
        if self._reset.stage is None:
            self._reset.begin(self._clock.now_s())
            self._tell(ResetStage.STOPPING)
            self._look()

    def link_lost(self) -> None:
        """The board that was to restart is gone."""
        self._end(ResetStage.LINK_LOST)

    def echoed(self, duty: tuple[float, ...], now_s: float) -> None:
        """The board said which command is in force."""
        if self._reset.stage is ResetStage.STOPPING:
            self._reset.echoed(duty, now_s)
            self._look()

    def turned(self, counts: tuple[int, ...], now_s: float) -> None:
        """The board said how far its wheels have turned."""
        if self._reset.stage is ResetStage.STOPPING:
            self._reset.counted(counts, now_s)
            self._look()

    def reset_done(self, now_s: float) -> None:
        """The board said that it is about to restart."""
        self._watch.reset_done(now_s)

    def counted(self, now_s: float, counts: tuple[int, ...], *, has_clock: bool) -> str | None:
        """An encoder line came: how it shows that the board has restarted (``noticed`` is to follow); None if not."""
        cause = self._watch.observe(now_s, counts, has_clock=has_clock)
        if cause is None and self._watch.has_gone_on:
            self._watch.has_gone_on = False
            if self._reset.stage is ResetStage.ASKED:
                self._end(ResetStage.NOT_RESTARTED)
            else:
                log.warning("the board sent 'Reset Done' without being asked, and continued")
        return cause

    def noticed(self, now_s: float, cause: str) -> None:
        """The board has restarted."""
        self.count += 1
        self._watch.restarted()
        self._bus.publish(BoardRestarted(now_s, cause))
        self._end(ResetStage.RESTARTED)

    def _look(self) -> None:
        """Ask as soon as the robot stands and the port takes it; give the board up when it is not back in time."""
        self._cancel_timer()
        now_s = self._clock.now_s()
        if self._reset.is_overdue(now_s):
            self._end(ResetStage.NO_ANSWER)
            return
        if self._reset.may_ask(now_s) and self._writer.has_drained():
            self._writer.write(self._request_line, now_s)
            self._reset.asked(now_s)
            self._tell(ResetStage.ASKED)
        wait_s = max(self._reset.look_again_s - now_s, LOOK_AGAIN_S)
        self._timer = self._clock.call_later(wait_s, self._look, TIMER)

    def _end(self, stage: ResetStage) -> None:
        self._cancel_timer()
        if self._reset.stage is not None:
            self._reset.end()
            self._tell(stage)

    def _tell(self, stage: ResetStage) -> None:
        self._bus.publish(BoardResetProgressed(self._clock.now_s(), str(stage), REASONS[stage]))
        logged = log.info if stage in ENDS_WELL else log.warning
        logged("restart of the board", stage=str(stage), reason=REASONS[stage])

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
