"""What the board says: each message as an event, at the time of the cycle that it belongs to."""

from typing import Any

import structlog

from chefbotd.core.events import DutyEchoed, EdgesSeen, EncodersCounted, LineRefused, TextReceived
from chefbotd.link.board_clock import BoardClock, Verdict
from chefbotd.link.cycle_clock import CycleClock
from chefbotd.link.edges import EdgeBasket
from chefbotd.link.health import show
from chefbotd.link.readings import Reading, readings, refusal
from chefbotd.link.restarts import Restarts
from chefbotd.link.send_window import SendWindow
from chefbotd.logs import RateLimitedLog
from firmware_protocol import messages as wire
from firmware_protocol.codec import Variant, from_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.line_codec import RESET_DONE

log = structlog.get_logger(component="link")


class BoardReader:
    """Follows the board's clock, and tells ``window`` and ``restarts`` what they have to know.

    ``events`` has a function for each class of message: its event at a time of the host, or None.
    """

    def __init__(self, variant: Variant, window: SendWindow, restarts: Restarts) -> None:
        self._window, self._restarts, self._wheels = window, restarts, variant.wheels
        self.decoder = Decoder(from_board(variant))
        self.board_clock, self._cycle_clock = BoardClock(), CycleClock()
        self._cycle_has_time = False
        self._edges = EdgeBasket(self.board_clock) if variant.speaks(wire.QuadratureEdges) else None
        self._log = RateLimitedLog(log)
        self.events: dict[type[Any], Reading] = {
            **readings(self.board_clock),
            wire.BoardTime: self._on_time,
            wire.EncoderCounts: self._on_encoders,
            wire.DutyEcho: self._on_echo,
            wire.QuadratureEdges: self._on_edges,
            wire.QuadratureStill: self._on_edges,
            wire.Banner: self._on_banner,
            wire.ResetDone: self._on_reset_done,
            wire.Malformed: self._on_malformed,
        }

    def begin(self) -> None:
        """A port was opened: forget half a line and half a cycle."""
        self.decoder.reset()
        self._cycle_has_time = False

    def _on_time(self, message: wire.BoardTime, now_s: float) -> EdgesSeen | None:
        verdict = self.board_clock.observe(message.micros, message.cycle_s, now_s)
        self._cycle_has_time = verdict is not Verdict.SUSPECT
        if verdict is Verdict.RESTARTED:
            self._restarted(now_s, f"its clock went back to {message.micros} us")
        if self._edges is None or self.board_clock.in_doubt:
            return None
        self._window.cycle(now_s)
        bursts = self._edges.empty()
        totals = {burst.wheel: burst.total for burst in bursts}
        if len(totals) == self._wheels:
            self._restarts.turned(tuple(totals[wheel] for wheel in sorted(totals)), now_s)
        return EdgesSeen(self.board_clock.stamp_s, now_s, self.board_clock.board_s(now_s), bursts)

    def _on_echo(self, message: wire.DutyEcho, now_s: float) -> DutyEchoed:
        self._window.echoed(message.duty)
        self._restarts.echoed(message.duty, now_s)
        return DutyEchoed(now_s - self.board_clock.late_s, now_s, message.duty)

    def _on_edges(self, message: wire.QuadratureEdges | wire.QuadratureStill, now_s: float) -> None:
        """Edges wait for the ``t`` line that closes their cycle; in doubt about it, for the next."""
        if self._edges is not None:
            self._edges.put(message)

    def _on_encoders(self, message: wire.EncoderCounts, now_s: float) -> EncodersCounted | None:
        """Counts are stamped with their cycle's own time; in doubt about it they wait for the next cycle."""
        self._window.cycle(now_s)
        if self.board_clock.in_doubt:
            return None
        stamp_s, board_s = self._printed_s(now_s)
        cause = self._restarts.counted(now_s, message.counts, has_clock=self.board_clock.latest_s is not None)
        if cause is not None:
            self._restarted(now_s, cause)
        self._restarts.turned(message.counts, now_s)
        return EncodersCounted(stamp_s, now_s, board_s, message.counts)

    def _printed_s(self, now_s: float) -> tuple[float, float]:
        """By the host and by the board: the cycle's own time; the read's where that was lost; else by even cycles."""
        clock_s = self.board_clock.latest_s
        if clock_s is None:
            printed_s = self._cycle_clock.observe(now_s)
            return min(printed_s, now_s), printed_s
        has_time, self._cycle_has_time = self._cycle_has_time, False
        if has_time:
            return self.board_clock.stamp_s, clock_s
        return now_s - self.board_clock.late_s, self.board_clock.board_s(now_s)

    def _on_reset_done(self, message: wire.ResetDone, now_s: float) -> TextReceived:
        self._restarts.reset_done(now_s)
        return TextReceived(now_s, RESET_DONE)

    def _on_banner(self, message: wire.Banner, now_s: float) -> TextReceived:
        """The first banner line after others is a restart; the rest of the banner belongs to it."""
        if self.board_clock.latest_s is not None:
            self.board_clock.restart()
            self._restarted(now_s, f"it printed {message.text!r}")
        return TextReceived(now_s, message.text)

    def _on_malformed(self, message: wire.Malformed, now_s: float) -> LineRefused:
        self._log.warning(
            "line refused", reason=message.reason, line=show(message.line), detail=message.detail
        )
        return refusal(message, now_s)

    def _restarted(self, now_s: float, cause: str) -> None:
        self._window.restarted()
        if self._edges is not None:
            self._edges.forget()
        self._restarts.noticed(now_s, cause)
