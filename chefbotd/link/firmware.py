"""Negotiates the checked mode with a board that runs our own firmware, and follows what such a board says of itself.

Nothing is written to a board that has not named itself, or sent a checked line: a classic sketch hears what it always
heard. Everything happens in the calls that bring bytes or commands; there is no timer.
"""

import math
from collections.abc import Callable

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import FirmwareReported, SafetyChanged
from chefbotd.core.record import StatefulPart
from chefbotd.inputs import inputs_of
from chefbotd.link.board_clock import BoardClock
from chefbotd.link.board_memory import BoardMemory
from chefbotd.link.board_writer import BoardWriter
from chefbotd.link.firmware_state import (
    REFUSALS,
    FirmwareState,
    LineQuality,
    no_answer,
    no_name,
    report,
)
from chefbotd.link.send_window import SendWindow
from chefbotd.link.wheel_loop import CAPABILITY, WheelLoop
from chefbotd.logs import RateLimitedLog
from firmware_protocol import messages as wire
from firmware_protocol.checked import PROTO, FirmwareCodec, Sealer, checked_to_board
from firmware_protocol.codec import Variant

log = structlog.get_logger(component="link")

ANSWER_S = 0.3
"""How long an answer to a hello is waited for; the next one follows then."""

MOST_HELLOS = 3
"""After so many without an answer the line counts as bad, which is said; the board is asked again."""

AGAIN_S = 1.0
"""After the hellos without an answer it is asked again as often: it stands until it has answered."""

HELLO_AGAIN_S = 0.5
"""The stops that a robot at rest is sent are not checked, and two seconds without a checked line end the mode."""

ARMING_S = 1.0
"""For so long after the robot was armed, a stop that the board has latched is the old one, and is ended.

Where the robot was armed in the classic mode, in which the board tells no stops: from the checked mode on.
"""

STOP_AGAIN_S = 0.1
"""A latched stop that the board lacks, or an end of one, is written again so often at most."""

ESTOP = b"estop\r"
MOST_ASKS = 3
ABOUT_BYTES = len(b"about 255*29B1\r")
HELLO_BYTES = len(b"hello 1 2000 255*29B1\r")
PARAMETER_BYTES = len(b"g 0 65535 255*29B1\r")

STRANGER_LINES, STRANGER_S, STRANGER_SHARE = 40, 4.0, 0.02
"""So many lines, for so long, of which fewer are damaged, and no name among them: ours would have said it four times."""
UNKNOWN_DEADMAN = (
    f"the board sends checked lines, but answered none of {MOST_HELLOS} hellos: its dead-man is not known"
)


class BoardFirmware(StatefulPart[FirmwareState]):
    """The firmware on the other end of a session.

    ``codec`` decodes the board's lines, and so knows their mode. Unless it ``negotiates``, nothing is ever written.
    ``quality`` tells how whole the board's lines have come since the port was opened, ``memory`` what the board was
    when an earlier daemon heard it.
    Call ``look_at_mode`` and ``greet`` after each read.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        writer: BoardWriter,
        window: SendWindow,
        variant: Variant,
        *,
        negotiates: bool,
        deadman_ms: int,
        quality: Callable[[], LineQuality],
        memory: BoardMemory,
    ) -> None:
        self._bus, self._clock, self._writer, self._window = bus, inputs_of(clock), writer, window
        self._negotiates, self._hello = negotiates, wire.Hello(PROTO, deadman_ms)
        self.codec = FirmwareCodec(variant)
        self._sealer = Sealer(checked_to_board(variant))
        self._log = RateLimitedLog(log)
        self._quality, self._board_memory = quality, memory
        self.memory = FirmwareState(was_ours=memory.recall())
        self.loop = WheelLoop()
        bus.add_handler(self._on_safety, SafetyChanged)

    def state(self) -> FirmwareState:
        """Return the state of this part."""
        self.memory.sequence = self._sealer.sequence
        return self.memory

    def restore(self, state: FirmwareState) -> None:
        """Restore this state; the codec is restored by itself."""
        super().restore(state)
        self._sealer.sequence = state.sequence
        self._window.set_mode(is_checked=state.is_checked)

    def begin(self) -> None:
        """A port was opened, or is gone: nothing is known of the board behind it."""
        was_known, armed, estopped = self.memory.is_known, self.memory.armed, self.memory.estopped
        self.memory = FirmwareState(
            armed=armed, estopped=estopped, was_ours=was_known or self.memory.was_ours
        )
        self.codec.reset()
        self.loop.reset()
        self._window.set_mode(is_checked=False)
        if was_known:
            self._bus.publish(self.report(self._clock.now_s()))

    def board_restarted(self, now_s: float) -> None:
        """The board has restarted: it is in the classic mode, and may be asked again."""
        self.codec.reset()
        self.look_at_mode(now_s)
        self.memory.complaint = self.memory.complaint_kind = ""
        if self.memory.is_known:
            self._ask_soon(now_s)

    @property
    def holds_motion(self) -> bool:
        """Whether the board is ours and its checked mode is not in force: it stands then.

        On the classic wire a damaged line may be another command, and nothing would stop the board by itself.
        """
        now = self.memory
        return self._negotiates and (now.is_known or now.was_ours) and not now.is_checked

    def judge_stranger(self, now_s: float) -> None:
        """Whether another board was plugged in where ours was: its classic lines are whole, and none is a name."""
        now = self.memory
        if not now.was_ours or now.is_known or not self._negotiates:
            return
        heard = self._quality()
        if heard.seconds < STRANGER_S or heard.lines < STRANGER_LINES:
            return
        now.was_ours = heard.damaged > STRANGER_SHARE * heard.lines
        if now.was_ours:
            self._complain("no name", no_name(heard), now_s)
        else:
            self._board_memory.keep(is_ours=False)
            now.complaint = now.complaint_kind = ""
            log.info("the board at this port does not run our firmware any more")

    def _recognize(self) -> None:
        """It is ours, as its name or a checked line says."""
        now = self.memory
        if not now.is_known:
            now.is_known = True
            if not now.was_ours:
                self._board_memory.keep(is_ours=True)

    # What is written

    def seal(self, line: bytes, now_s: float) -> bytes:
        """A command as a checked line, which the board echoes by its number."""
        now = self.memory
        now.newest_command = self._sealer.sequence
        now.written_s[now.newest_command] = now_s
        self.loop.note_sent(now.newest_command)
        return self._sealer.seal(line)

    def reset_line(self, plain: bytes) -> bytes:
        """The line that restarts the board, in its mode."""
        return self._sealer.seal(plain) if self.memory.is_checked else plain

    def greet(self, now_s: float) -> None:
        """Write a hello if one is due and the board has room for it; else the next read will."""
        now = self.memory
        if now_s < now.due_s or not self._writer.has_drained() or not self._window.has_room(HELLO_BYTES):
            return
        if now.unanswered >= MOST_HELLOS:
            if not now.is_checked:
                self._stop_asking(now_s)
                return
            self._complain(UNKNOWN_DEADMAN, UNKNOWN_DEADMAN, now_s)
        now.hello_sequence, now.hello_s = self._sealer.sequence, now_s
        now.unanswered, now.due_s = now.unanswered + 1, now_s + ANSWER_S
        self._write_line(self._sealer.encode(self._hello), now_s)

    def set_up_loop(self, now_s: float) -> None:
        """Write the next parameter of the wheel loop, if the board has one and room for it; else the next read will."""
        now = self.memory
        has_loop = now.named is not None and bool(now.named.capabilities & CAPABILITY)
        if now.answer is None or not has_loop or not self._window.has_room(PARAMETER_BYTES):
            return
        parameter = self.loop.next_parameter(now_s)
        if parameter is not None:
            self._write_line(self._sealer.encode(wire.SetParameter(*parameter)), now_s)

    def _write_line(self, line: bytes, now_s: float) -> None:
        self._writer.write(line, now_s)
        self._window.note_other(len(line), now_s)

    def _ask_soon(self, now_s: float) -> None:
        now = self.memory
        now.unanswered = 0
        if self._negotiates:
            now.due_s = max(now_s, now.hello_s + ANSWER_S)

    def _stop_asking(self, now_s: float) -> None:
        now = self.memory
        now.due_s, now.unanswered = now_s + AGAIN_S, 0
        self._complain("no answer", no_answer(self._quality(), now.counters_before, MOST_HELLOS), now_s)

    def _complain(self, kind: str, reason: str, now_s: float) -> None:
        """Say once what is wrong with the negotiation."""
        if self.memory.complaint_kind != kind:
            self.memory.complaint_kind, self.memory.complaint = kind, reason
            log.warning("the board does not agree on the checked mode", reason=reason)
            self._bus.publish(self.report(now_s))

    # What the gate decides

    def _on_safety(self, event: SafetyChanged) -> None:
        """Latch an e-stop on the board too, and end it when the robot is armed again."""
        now, now_s = self.memory, self._clock.now_s()
        was_armed, was_estopped, now.latched_s = now.armed, now.estopped, -math.inf
        now.estopped = event.mode == "estopped"
        now.armed = not now.estopped and event.mode != "disarmed"
        if now.estopped and not was_estopped:
            self._stop_board(now_s)
        if not now.armed:
            now.arming_until_s = -math.inf
        elif not was_armed and now.is_known:
            now.arming_until_s = now_s + ARMING_S if now.is_checked else math.inf
            self._arm_board(now_s)

    def _stop_board(self, now_s: float) -> None:
        if self._negotiates and self.memory.is_known:
            self._write_line(ESTOP, now_s)

    def _arm_board(self, now_s: float) -> None:
        board = self.memory.board
        if self.memory.is_checked and board is not None and self.memory.has_latched:
            self._write_line(self._sealer.encode(wire.Arm(board.estop)), now_s)

    # What the board says

    def look_at_mode(self, now_s: float) -> None:
        """Follow the mode of the board's lines; commands are sealed from now on, or not any more."""
        now, is_checked = self.memory, self.codec.is_checked
        if now.is_checked is is_checked:
            return
        if is_checked:
            self._recognize()
        now.is_checked = is_checked
        self._window.set_mode(is_checked=is_checked)
        self.loop.reset()
        now.written_s, now.newest_command, now.echoed = {}, -1, -1
        if not is_checked:
            now.counters_before = now.counters or now.counters_before
            now.answer = now.board = now.counters = None
        elif now.arming_until_s == math.inf:
            now.arming_until_s = now_s + ARMING_S
        self._ask_soon(now_s)
        log.info("the board's lines are " + ("checked" if is_checked else "classic again"))
        self._bus.publish(self.report(now_s))

    def named(self, message: wire.Firmware, now_s: float) -> FirmwareReported | None:
        """It is our firmware: greet it, unless that was tried in vain."""
        now = self.memory
        is_new, now.named = now.named != message, message
        if not now.is_known:
            self._recognize()
            self._ask_soon(now_s)
        return self.report(now_s) if is_new else None

    def answered(self, message: wire.HelloAnswer, now_s: float, clock: BoardClock) -> FirmwareReported | None:
        """The checked mode is agreed on; the hello measures the line and both clocks."""
        now = self.memory
        if message.of != now.hello_sequence or not now.unanswered:
            return None
        is_first, now.answer = now.answer is None, message
        now.unanswered = 0
        if disagreement := self._disagreement(message):
            self._complain(disagreement, disagreement, now_s)
        else:
            is_first, now.complaint = is_first or bool(now.complaint), ""
            now.complaint_kind = ""
        now.due_s = now.hello_s + HELLO_AGAIN_S
        now.note_round_trip(now_s - now.hello_s)
        taken_s = clock.time_of_s(message.micros)
        if taken_s is not None:
            now.clock_late_s = clock.relation.host_s(taken_s) - (now.hello_s + now_s) / 2
        self._window.all_read()
        if not is_first:
            self._ask_about(now_s)
        return self.report(now_s) if is_first else None

    def _ask_about(self, now_s: float) -> None:
        """Ask what it counts and which build it is, until it has answered; one that does not know that refuses it."""
        now = self.memory
        if now.about is None and now.about_asks < MOST_ASKS and self._window.has_room(ABOUT_BYTES):
            now.about_asks, now.about_sequence = now.about_asks + 1, self._sealer.sequence
            self._write_line(self._sealer.encode(wire.AskAbout()), now_s)

    def told_about(self, message: wire.BoardAbout, now_s: float) -> FirmwareReported:
        """What the board counts, and which build it is."""
        self.memory.about = message
        self.loop.limit_edges(message.most_edges_s)
        return self.report(now_s)

    def _disagreement(self, message: wire.HelloAnswer) -> str:
        """What the board has answered other than was asked for; empty if nothing."""
        asked = self._hello
        if (message.proto, message.deadman_ms) == (asked.proto, asked.deadman_ms):
            return ""
        return (
            f"the board answered with protocol {message.proto} and a dead-man of {message.deadman_ms} ms, where "
            f"protocol {asked.proto} and {asked.deadman_ms} ms were asked for"
        )

    def echoed(self, of: int, now_s: float) -> None:
        """The command of this number is in force: when it is the newest, the board has read all."""
        now = self.memory
        if of == now.newest_command:
            self._window.all_read()
        if of != now.echoed:
            now.echoed = of
            written_s = now.written_s.pop(of, None)
            if written_s is not None:
                now.note_round_trip(now_s - written_s)

    def told_state(self, message: wire.BoardState, now_s: float) -> FirmwareReported | None:
        """Which stops are in force; one that was lost on the wire is asked for again, and so is the end of one."""
        now = self.memory
        is_new, now.board = now.board != message, message
        is_latched = now.has_latched
        if now_s - now.latched_s >= STOP_AGAIN_S:
            if now.estopped and not is_latched:
                now.latched_s = now_s
                self._stop_board(now_s)
            elif is_latched and now.armed and now_s < now.arming_until_s:
                now.latched_s = now_s
                self._arm_board(now_s)
        return self.report(now_s) if is_new else None

    def counted(self, message: wire.BoardCounters, now_s: float) -> FirmwareReported:
        """What was damaged, refused, lost and late on the board."""
        self.memory.counters = message
        return self.report(now_s)

    def refused(self, message: wire.CommandRefused, now_s: float) -> None:
        """The board refuses a line that arrived whole."""
        if message.of == self.memory.about_sequence and self.memory.about is None:
            self.memory.about_asks = MOST_ASKS  # an older firmware
            return
        reason = REFUSALS.get(message.what, f"reason {message.what}")
        self._log.warning("the board refused a line", reason=reason, line=message.of)

    def report(self, now_s: float) -> FirmwareReported:
        """Everything that is known of it."""
        return report(self.memory, now_s, lines_lost=self.codec.lost)
