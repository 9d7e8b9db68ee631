"""What the board says: each message as an event, at the time of the cycle that it belongs to."""

from collections.abc import Callable, Mapping
from itertools import accumulate
from typing import Any, TypeAlias

import structlog
from msgspec import field

from chefbotd.core.events import (
    AnalogueCounted,
    BatteryCounted,
    DutyEchoed,
    EdgeBurst,
    EdgesSeen,
    EncodersCounted,
    InertialCounted,
    LineRefused,
    OrientationReported,
    TextReceived,
    UltrasonicEchoed,
)
from chefbotd.core.record import MutableState, Record, StatefulPart, StatefulValue
from chefbotd.link.board_clock import BoardClock, CycleClock, StampVerdict
from chefbotd.link.firmware import BoardFirmware
from chefbotd.link.health import show
from chefbotd.link.restarts import Restarts
from chefbotd.link.send_window import SendWindow
from chefbotd.logs import RateLimitedLog
from firmware_protocol import messages as wire
from firmware_protocol.checked import ModeState
from firmware_protocol.codec import Variant
from firmware_protocol.decoder import Decoder, DecoderState
from firmware_protocol.line_codec import RESET_DONE
from firmware_protocol.messages import QuadratureEdges, QuadratureStill

Reading = Callable[[Any, float], Record | None]
"""The event that a frame stands for, from when its bytes were read; None where it stands for none."""


def readings(clock: BoardClock) -> Mapping[type[Any], Reading]:
    """Converts a sensor's frames to measurements, with the delay of the clock's last line."""
    return {
        wire.UltrasonicDistance: lambda frame, s: UltrasonicEchoed(s - clock.late_s, s, frame.distance_cm),
        wire.Orientation: lambda frame, s: OrientationReported(
            s - clock.late_s, s, frame.x, frame.y, frame.z, frame.w
        ),
        wire.RawImu: lambda frame, s: InertialCounted(
            s - clock.late_s, s, frame.acceleration, frame.angular_rate
        ),
        wire.AgedDistance: lambda frame, s: UltrasonicEchoed(
            s - clock.late_s - frame.age_us * 1e-6, s, frame.distance_cm
        ),
        wire.AgedImu: lambda frame, s: InertialCounted(
            s - clock.late_s - frame.age_us * 1e-6, s, frame.acceleration, frame.angular_rate
        ),
        wire.BatteryLevel: lambda frame, s: BatteryCounted(s - clock.late_s, s, frame.adc),
        wire.AnalogueLevel: lambda frame, s: AnalogueCounted(s - clock.late_s, s, frame.channel, frame.adc),
        wire.Text: lambda frame, s: TextReceived(s, frame.text),
    }


def refusal(line: wire.Malformed, now_s: float) -> LineRefused:
    """The event of a line that is no frame."""
    return LineRefused(now_s, line.reason, line.line, line.detail)


MOST_BURSTS = 256
"""A board whose `t` lines are all damaged must not fill the memory: beyond this the oldest bursts are lost."""


EdgesOrStill: TypeAlias = tuple[QuadratureEdges | None, QuadratureStill | None]
"""Either kind of burst."""


class BurstBuffer(StatefulValue[list[EdgesOrStill]]):
    """Collects bursts in the order in which they came, and dates them by the board's clock."""

    def __init__(self, clock: BoardClock) -> None:
        self._clock = clock
        self.memory: list[EdgesOrStill] = []

    def put(self, burst: QuadratureEdges | QuadratureStill) -> None:
        """Keep a burst for the cycle's end."""
        self.memory.append((burst, None) if isinstance(burst, QuadratureEdges) else (None, burst))
        del self.memory[:-MOST_BURSTS]

    def forget(self) -> None:
        """Forget the bursts: the board has restarted, and so has its clock."""
        self.memory.clear()

    def empty(self) -> tuple[EdgeBurst, ...]:
        """Every burst collected since the last time, dated; none before the clock has been read."""
        kept = [burst for pair in self.memory for burst in pair if burst is not None]
        self.memory.clear()
        return tuple([dated for burst in kept if (dated := self._dated(burst)) is not None])

    def _dated(self, burst: QuadratureEdges | QuadratureStill) -> EdgeBurst | None:
        if isinstance(burst, QuadratureStill):
            return EdgeBurst(burst.wheel, burst.total, (), ())
        last_s = self._clock.time_of_s(burst.micros)
        if last_s is None:
            return None
        before_us = accumulate(reversed(burst.gaps_us), initial=0)
        times_s = [last_s - us * 1e-6 for us in before_us]
        return EdgeBurst(burst.wheel, burst.total, burst.states, tuple(reversed(times_s)))


log = structlog.get_logger(component="link")


class BoardReaderState(MutableState):
    """Its half line and half cycle, and the clocks that it follows."""

    decoder: DecoderState
    mode: ModeState
    board_clock: BoardClock
    cycle_clock: CycleClock = field(default_factory=CycleClock)
    cycle_has_time: bool = False
    edges: list[EdgesOrStill] = []


class BoardReader(StatefulPart[BoardReaderState]):
    """Follows the board's clock, and tells ``window``, ``restarts`` and ``firmware`` what they have to know.

    ``events`` has a function for each class of message: its event at a time of the host, or None.
    """

    def __init__(
        self, variant: Variant, window: SendWindow, restarts: Restarts, firmware: BoardFirmware
    ) -> None:
        self._window, self._restarts, self._wheels = window, restarts, variant.wheels
        self._firmware = firmware
        self.decoder = Decoder(firmware.codec)
        self.board_clock = BoardClock()
        self.on_loop_ready: Callable[[], None] = lambda: None
        self.on_refused: Callable[[wire.Malformed], None] = lambda line: None
        self._edges = BurstBuffer(self.board_clock) if variant.speaks(wire.QuadratureEdges) else None
        self.memory = BoardReaderState(self.decoder.state(), firmware.codec.state(), self.board_clock)
        self.parts = {"decoder": self.decoder, "mode": firmware.codec, "board_clock": self.board_clock}
        if self._edges is not None:
            self.parts["edges"] = self._edges
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
            wire.SequencedEcho: self._on_sequenced_echo,
            wire.Firmware: firmware.named,
            wire.HelloAnswer: lambda answer, s: firmware.answered(answer, s, self.board_clock),
            wire.BoardAbout: firmware.told_about,
            wire.BoardState: firmware.told_state,
            wire.BoardCounters: firmware.counted,
            wire.CommandRefused: firmware.refused,
            wire.ParameterSet: self._on_parameter,
        }

    def begin(self) -> None:
        """A port was opened: forget half a line and half a cycle."""
        self.decoder.reset()
        self.memory.cycle_has_time = False

    def _on_time(self, message: wire.BoardTime, now_s: float) -> EdgesSeen | None:
        verdict = self.board_clock.observe(message.micros, message.cycle_s, now_s)
        self.memory.cycle_has_time = verdict is not StampVerdict.SUSPECT
        if verdict is StampVerdict.RESTARTED:
            self._restarted(now_s, f"its clock went back to {message.micros} us")
        if self._edges is None or self.board_clock.in_doubt:
            return None
        self._window.cycle(now_s)
        bursts = self._edges.empty()
        totals = {burst.wheel: burst.total for burst in bursts}
        if len(totals) == self._wheels:
            self._restarts.turned(tuple(totals[wheel] for wheel in sorted(totals)), now_s)
        return EdgesSeen(self.board_clock.stamp_s, now_s, self.board_clock.board_s(now_s), bursts)

    def _on_echo(self, message: wire.DutyEcho | wire.SequencedEcho, now_s: float) -> DutyEchoed:
        self._window.echoed(message.duty)
        self._restarts.echoed(message.duty, now_s)
        return DutyEchoed(now_s - self.board_clock.late_s, now_s, message.duty)

    def _on_sequenced_echo(self, message: wire.SequencedEcho, now_s: float) -> DutyEchoed:
        self._firmware.echoed(message.of, now_s)
        loop = self._firmware.loop
        if not loop.drives:
            return self._on_echo(message, now_s)
        command, duty = loop.obeyed(message.of, message.duty)
        self._window.echoed(command)
        self._restarts.echoed(duty, now_s)
        return DutyEchoed(now_s - self.board_clock.late_s, now_s, duty)

    def _on_parameter(self, message: wire.ParameterSet, now_s: float) -> None:
        """The last parameter of the wheel loop changes what commands are: what waits is none any more."""
        if self._firmware.loop.confirm(message.parameter, message.value):
            self.on_loop_ready()

    def _on_edges(self, message: wire.QuadratureEdges | wire.QuadratureStill, now_s: float) -> None:
        """Edges wait for the ``t`` line that closes their cycle; in doubt about it, for the next."""
        if self._edges is not None:
            self._edges.put(message)

    def _on_encoders(self, message: wire.EncoderCounts, now_s: float) -> EncodersCounted | None:
        """Counts are stamped with their cycle's own time; in doubt about it they wait for the next cycle."""
        counts, restarts, clock = message.counts, self._restarts, self.board_clock
        self._window.cycle(now_s)
        if clock.in_doubt:
            return None
        clock_s = clock.latest_s
        stamp_s, board_s = self._printed_s(now_s, clock_s)
        cause = restarts.counted(now_s, counts, has_clock=clock_s is not None)
        if cause is not None:
            self._restarted(now_s, cause)
        restarts.turned(counts, now_s)
        return EncodersCounted(stamp_s, now_s, board_s, counts)

    def _printed_s(self, now_s: float, clock_s: float | None) -> tuple[float, float]:
        """By the host and by the board: the cycle's own time; the read's where that was lost; else by even cycles."""
        if clock_s is None:
            printed_s = self.memory.cycle_clock.observe(now_s)
            return min(printed_s, now_s), printed_s
        has_time, self.memory.cycle_has_time = self.memory.cycle_has_time, False
        if has_time:
            return self.board_clock.stamp_s, clock_s
        return now_s - self.board_clock.late_s, self.board_clock.board_s(now_s)

    def _on_reset_done(self, message: wire.ResetDone, now_s: float) -> TextReceived:
        self._restarts.reset_done(now_s)
        return TextReceived(now_s, RESET_DONE)

    def _on_banner(self, message: wire.Banner, now_s: float) -> TextReceived:
        """The first banner line after others is a restart; the rest of the banner belongs to it."""
        if self.board_clock.latest_s is not None:
            self.board_clock.expect_new_count()
            self._restarted(now_s, f"it printed {message.text!r}")
        return TextReceived(now_s, message.text)

    def _on_malformed(self, message: wire.Malformed, now_s: float) -> LineRefused:
        self._log.warning(
            "line refused", reason=message.reason, line=show(message.line), detail=message.detail
        )
        self.on_refused(message)
        return refusal(message, now_s)

    def _restarted(self, now_s: float, cause: str) -> None:
        self._window.restarted()
        if self._edges is not None:
            self._edges.forget()
        self._restarts.noticed(now_s, cause)
        self._firmware.board_restarted(now_s)
