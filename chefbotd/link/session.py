"""The board as seen from the wire: bytes in, stamped events out; duties in, bytes out."""

import asyncio
from functools import lru_cache, partial
from typing import cast

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events import (
    Direction,
    DutyWritten,
    LineSeen,
    LinkClosed,
    LinkHealthChanged,
    LinkNotOpened,
    LinkOpened,
)
from chefbotd.core.events.inputs import SetpointWithdrawn
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.inputs import inputs_of
from chefbotd.link.board_memory import BoardMemory, NoBoardMemory
from chefbotd.link.board_reader import BoardReader, BoardReaderState
from chefbotd.link.board_writer import FIRST_STOPS, LINES_LOGGED, BoardWriter, LineRing, WriterState
from chefbotd.link.counting import Counting
from chefbotd.link.firmware import BoardFirmware
from chefbotd.link.firmware_state import FirmwareState
from chefbotd.link.health import Condition, LinkHealth, LinkMonitor, LinkMonitorState
from chefbotd.link.port import PortTransport
from chefbotd.link.restarts import Restarts, RestartsState
from chefbotd.link.send_window import SendWindow, WindowState
from chefbotd.link.setpoint import SetpointState, SetpointWriter
from chefbotd.link.wheel_loop import WheelLoopState
from firmware_protocol import messages as wire
from firmware_protocol.checked import checked_to_board
from firmware_protocol.codec import Variant, to_board

log = structlog.get_logger(component="link")

LINES_CACHED = 64
"""A command is asked for its length twice before it is written, and a robot at speed repeats a few commands."""


MOTORS_FIRST = frozenset({wire.EncoderCounts, wire.BoardTime})
"""What makes an event that is answered by a motor command; what else is in the same read is handled after that."""


class BoardSessionState(MutableState):
    """What the session remembers of its board, but for the port itself."""

    reader: BoardReaderState
    writer: WriterState
    restarts: RestartsState
    window: WindowState
    setpoints: SetpointState
    monitor: LinkMonitorState
    firmware: FirmwareState
    loop: WheelLoopState
    opens: int = 0


class BoardSession(asyncio.Protocol, StatefulPart[BoardSessionState]):
    """An asyncio protocol that lives across reconnections and keeps its counters.

    Events go to the bus as they are read. The board's clock is followed across reconnections too: a board that went
    on counting while its cable was out is told from one that restarted. A board that counts otherwise than ``counting``
    says gets no motion.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        variant: Variant,
        *,
        device: str,
        setpoints_per_s: float,
        health_after_s: float = 2.0,
        board_buffer_bytes: int = 63,
        negotiates: bool = True,
        deadman_ms: int = 250,
        counting: Counting | None = None,
        memory: BoardMemory | None = None,
    ) -> None:
        clock = inputs_of(clock)
        self._bus, self._clock, self._device = bus, clock, device
        self._encoder = to_board(variant)
        self._still = (0,) * variant.wheels
        self._line = lru_cache(maxsize=LINES_CACHED)(self._encode_duty)
        self._speed_line = lru_cache(maxsize=LINES_CACHED)(self._encode_speeds)
        self._speed_encoder = checked_to_board(variant)
        size_of = lru_cache(maxsize=LINES_CACHED)(
            lambda command: len(self._speed_line(command))
        )  # as a duty's
        self.lines = LineRing()
        self.writer = BoardWriter(bus, clock, self.lines, self._encoder.encode(wire.SetDuty(self._still)))
        self.restarts = Restarts(bus, clock, self.writer, self._reset_line)
        self._window = SendWindow(board_buffer_bytes, variant.wheels, size_of)
        self.firmware = BoardFirmware(
            bus,
            clock,
            self.writer,
            self._window,
            variant,
            negotiates=negotiates,
            deadman_ms=deadman_ms,
            quality=lambda: self.monitor.quality(clock.now_s()),
            memory=memory or NoBoardMemory(),
        )
        self.setpoints = SetpointWriter(
            self._write_duty,
            self.writer.has_drained,
            clock.now_s,
            interval_s=1.0 / setpoints_per_s,
            window=self._window,
            call_later=partial(clock.call_later, name="board setpoint"),
            on_withdrawn=self._record_withdrawn,
        )
        self._reader = BoardReader(variant, self._window, self.restarts, self.firmware)
        self._reader.on_loop_ready = self._begin_loop
        self._decoder, self._events = self._reader.decoder, self._reader.events
        self.board_clock = self._reader.board_clock
        self._closed = asyncio.Event()
        self._closed.set()
        self.monitor = LinkMonitor(self._decoder, variant, health_after_s=health_after_s)
        self._reader.on_refused = self.monitor.note_refused
        self._counting = counting
        self._kind_held = None if counting is None else not counting.by_firmware
        self.is_open = False  # whether a port is connected
        self.memory = BoardSessionState(
            self._reader.memory,
            self.writer.memory,
            self.restarts.memory,
            self._window.memory,
            self.setpoints.memory,
            self.monitor.memory,
            self.firmware.memory,
            self.firmware.loop.memory,
        )
        self.parts = {
            "reader": self._reader,
            "writer": self.writer,
            "restarts": self.restarts,
            "window": self._window,
            "setpoints": self.setpoints,
            "monitor": self.monitor,
            "firmware": self.firmware,
            "loop": self.firmware.loop,
        }

    # What asyncio tells us

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """A port was opened: forget half lines and put a stop on the wire."""
        self.writer.begin(cast(PortTransport, transport))
        self.is_open = True
        self._reader.begin()
        self.firmware.begin()
        self.memory.opens += 1
        now_s = self._clock.now_s()
        self.monitor.begin(now_s)
        self.writer.stop_first(now_s)
        self._wrote(self._still, now_s, FIRST_STOPS)
        self._bus.publish(LinkOpened(now_s, self._device))

    def connection_lost(self, exc: Exception | None) -> None:
        """The port is gone; what waited to be written is forgotten."""
        self.writer.end()
        self.is_open = False
        self.setpoints.forget()
        self._window.forget()
        self.firmware.begin()
        self.restarts.link_lost()
        self._bus.publish(LinkClosed(self._clock.now_s(), self._device, str(exc) if exc else "closed"))
        self._closed.set()

    def resume_writing(self) -> None:
        """The transport has drained: the newest setpoint may go."""
        self.setpoints.resume()

    def data_received(self, data: bytes) -> None:
        """Stamp, decode and publish."""
        now_s = self._clock.now_s()
        self.monitor.count_bytes(data)
        lines, messages = self._decoder.read(data)
        self.lines.heard.append((now_s, lines[-LINES_LOGGED:]))
        bus, events, publish, firmware = self._bus, self._events, self._bus.publish, self.firmware
        seen = iter(lines) if bus.has_listeners(LineSeen) else None
        bus.hold()  # what the lines of one read say belongs together
        try:
            for message in messages:
                if seen is not None:
                    publish(LineSeen(now_s, Direction.FROM_BOARD, next(seen)))
                kind = type(message)
                event = events[kind](message, now_s)
                if event is not None:
                    publish(event)
                    if kind in MOTORS_FIRST:
                        bus.deliver()
                        bus.hold()
            if firmware.codec.is_checked is not firmware.memory.is_checked:
                firmware.look_at_mode(now_s)
        finally:
            bus.deliver()
        self.setpoints.heard()
        if now_s >= firmware.memory.due_s:
            firmware.greet(now_s)
        if firmware.loop.is_wanted and firmware.memory.is_checked:
            firmware.set_up_loop(now_s)

    @property
    def is_proven(self) -> bool:
        """Whether a frame has come in since the port was opened."""
        return self.monitor.proven

    def judge_health(self) -> None:
        """Look at what has come in lately; a change is published and logged. Call it a few times a second."""
        now_s = self._clock.now_s()
        self.firmware.judge_stranger(now_s)
        health = self.monitor.judge(now_s, self._complaint(now_s))
        if health is None or not self.is_open:
            return
        healthy = health.condition is Condition.HEALTHY
        self._bus.publish(
            LinkHealthChanged(now_s, self._device, healthy, str(health.condition), health.reason)
        )
        if not healthy:
            log.warning(
                "the link to the board is not healthy", condition=health.condition, reason=health.reason
            )

    def _complaint(self, now_s: float) -> LinkHealth | None:
        if shared := self.monitor.shared_complaint():
            return shared
        if self._counting is not None and self.firmware.memory.is_known is self._kind_held:
            return LinkHealth(Condition.COUNTS_DIFFER, self._counting.difference)
        if echo := self._window.complaint(now_s):
            return LinkHealth(Condition.ECHO_STUCK, echo)
        if unanswered := self.firmware.memory.complaint:
            return LinkHealth(Condition.NOT_NEGOTIATED, unanswered)
        return self.monitor.format_complaint(self.board_clock.newest)

    def report_not_opened(self, reason: str) -> None:
        """Publish why the port cannot be opened."""
        self._bus.publish(LinkNotOpened(self._clock.now_s(), self._device, reason))

    @property
    def refused_lines(self) -> int:
        """How many lines were refused so far."""
        return self._decoder.malformed.total()

    def report_sharers(self, sharers: str) -> None:
        """Other programs have the port open: ``judge_health`` says so from now on."""
        self.monitor.memory.sharers = sharers

    def expect_connection(self) -> None:
        """A port is about to be opened: ``wait_closed`` is to wait for its end."""
        self._closed.clear()

    async def wait_closed(self) -> None:
        """Wait until the expected connection has come and gone."""
        await self._closed.wait()

    # What the robot tells the board

    @property
    def _holds_motion(self) -> bool:
        """Whether the board may not be moved: it restarts, counts otherwise than is configured, or is unchecked."""
        firmware = self.firmware
        return (
            self.restarts.holds_motion or firmware.memory.is_known is self._kind_held or firmware.holds_motion
        )

    def send_duty(self, duty: tuple[int, ...]) -> None:
        """Put a motor command on the wire, replacing one that still waits; without a link it is dropped."""
        if self.is_open:
            if self._holds_motion:
                duty = self._still
            if self.firmware.loop.memory.is_ready:
                duty = self._command_of(duty)
            self.setpoints.offer(duty)

    def repeat_duty(self, duty: tuple[int, ...]) -> None:
        """The control loop lives, and has nothing new to say: feeds the board's dead-man, where it has one."""
        if self.firmware.memory.is_checked:
            self.send_duty(duty)

    def duty_ceiling(self, now_s: float) -> tuple[int, ...] | None:
        """The largest duty of each wheel while the board accepts no larger one; None: no such limit."""
        if not self.is_open:
            return None
        if self._holds_motion:
            return self._still
        ceiling = self.setpoints.ceiling(now_s)
        if ceiling is not None and self.firmware.loop.drives:
            return self.firmware.loop.duty_of(ceiling)
        return ceiling

    def stop_motors(self) -> None:
        """Write zeros at once; for every way out of the process."""
        self.send_duty(self._still)

    def stop_from_thread(self) -> bool:
        """Put zeros on the wire past a loop that stands still, from any thread: whether the port took them.

        A duty that still waits is withdrawn, or it would follow when the loop goes on.
        """
        self.withdraw_setpoint()
        return self.writer.stop_from_thread()

    def withdraw_setpoint(self) -> None:
        """Drop the duty that waits; may be called from any thread."""
        self.setpoints.withdraw()

    def _record_withdrawn(self) -> None:
        if self._clock.recording:
            self._clock.publish(SetpointWithdrawn(self._clock.now_s()))

    def reset_board(self) -> None:
        """Stop, see that the robot stands, then ask the board to restart; nothing moves until it is back.

        Returns at once: ``BoardResetProgressed`` tells how it goes on.
        """
        if self.is_open:
            self.stop_motors()
            self.restarts.begin()

    def close(self) -> None:
        """Stop the motors and give the port up: nothing that waits, or is said later, comes after this stop."""
        self.setpoints.forget()
        self.writer.stop_last()

    def _write_duty(self, duty: tuple[int, ...], now_s: float, first: bool) -> None:
        # The stop that ends a motion is obeyed without a checksum, those that repeat it feed the dead-man.
        if self.firmware.memory.is_checked and (duty != self._still or duty == self._window.memory.newest):
            self._write_checked(self._command_line(duty), now_s, first)
            self._wrote(duty, now_s, FIRST_STOPS if first else 1)
        elif first:  # only what slows
            self.writer.write_first(self._line(duty), now_s)
            self._wrote(duty, now_s, FIRST_STOPS)
        else:
            self.writer.write(self._line(duty), now_s)
            self._wrote(duty, now_s, 1)

    def _write_checked(self, line: bytes, now_s: float, first: bool) -> None:
        seal = self.firmware.seal
        if first:
            self.writer.write_first(seal(line, now_s), now_s, again=seal(line, now_s))
        else:
            self.writer.write(seal(line, now_s), now_s)

    def _reset_line(self) -> bytes:
        return self.firmware.reset_line(self._encoder.encode(wire.ResetBoard()))

    # The board's own wheel loop: a command is a speed of each wheel then

    def _begin_loop(self) -> None:
        """From now on commands are speeds; a duty that waits is dropped, and the next reading brings another."""
        self.setpoints.forget()
        log.info("the board's own wheel loop drives")

    def _command_of(self, duty: tuple[int, ...]) -> tuple[int, ...]:
        """What a board with a ready loop is told; a command of the other kind that waits is dropped."""
        loop = self.firmware.loop
        if loop.changes_over():
            self.setpoints.forget()
        return loop.command(duty) if loop.drives else duty

    def _command_line(self, command: tuple[int, ...]) -> bytes:
        is_speed = self.firmware.loop.drives and command != self._still
        return self._speed_line(command) if is_speed else self._line(command)

    def _encode_speeds(self, speeds: tuple[int, ...]) -> bytes:
        return self._speed_encoder.encode(wire.SetWheelSpeeds(speeds))

    def _encode_duty(self, duty: tuple[int, ...]) -> bytes:
        return self._encoder.encode(wire.SetDuty(duty))

    def _wrote(self, duty: tuple[int, ...], now_s: float, times: int) -> None:
        self._window.note(duty, now_s, times)
        loop = self.firmware.loop
        if loop.drives:
            duty = loop.duty_of(duty)
        loop.memory.written_duty = duty
        if self._bus.has_listeners(DutyWritten):
            self._bus.publish(DutyWritten(now_s, duty))

    # What is counted

    @property
    def bytes_in(self) -> int:
        """Bytes read so far."""
        return self.monitor.memory.bytes_in

    def unread_bytes(self) -> int:
        """How many bytes have come in and wait to be read; none without a port."""
        return self.writer.unread_bytes()

    @property
    def frames(self) -> dict[str, int]:
        """Accepted lines so far, by message name."""
        return dict(self._decoder.accepted)

    @property
    def refused(self) -> dict[str, int]:
        """Malformed lines so far, by reason."""
        return {str(reason): n for reason, n in self._decoder.malformed.items()}
