"""Opening the serial device, and a transport for it that writes at once."""

import asyncio
import contextlib
import errno
import os
import termios
import time
from enum import StrEnum
from typing import Any, Self

import serial
import serial_asyncio
import structlog
from pydantic import Field, field_validator, model_validator

from chefbotd.core.parameters import Parameters, check_device
from chefbotd.core.sentence import Sentence
from chefbotd.link.device_threads import DEVICE_THREADS
from chefbotd.link.early_stop import hand_over

log = structlog.get_logger(component="link")

IN_USE = (errno.EAGAIN, errno.EBUSY)
"""What a lock that another holds, or its exclusive mode, is refused with."""

STALE_S = 0.05
"""What is unsent after this is not waited for any longer: the shutdown stop goes instead of it."""

FLUSH_TIMEOUT_S = 1.2
"""The sketch may wait a second for an echo, and a board with USB of its own takes nothing meanwhile."""

LOOK_S = 0.001
READ_BYTES = 4096


class FirmwareMode(StrEnum):
    """Whether a board that names our firmware is asked for its checked mode."""

    AUTO = "auto"
    CLASSIC = "classic"


class LinkParameters(Parameters):
    """Where the board is and how the port behaves.

    ``device`` is a path (``/dev/ttyACM0``, better ``/dev/serial/by-id/...``) or ``socket://host:port``. ``dtr`` and
    ``rts`` are the states of these lines while open: some boards reset when they change. With ``hang_up_on_close`` the
    kernel drops DTR when the port is closed (HUPCL). Reconnection waits ``reconnect_delay_s``, doubling up to
    ``max_reconnect_delay_s`` until the board has spoken, each wait varied by ``reconnect_jitter`` of itself. A port on
    which no board is heard for ``health_after_s`` is reported unhealthy; the ultrasonic alone may silence one for a
    second. At most ``setpoints_per_s`` motor commands are written.

    ``board_buffer_bytes`` is what the board keeps of what it has not read yet; what it may have no room for is not sent.
    63 is the least of the published boards (the Arduino's; the core of the Tiva has 1024, assumed).

    With ``firmware`` ``auto`` the daemon agrees on the checked mode with a board that runs our firmware: it stops by
    itself when it hears no command for ``deadman_ms``. With ``classic`` such a board is driven like a classic sketch.
    With ``wheel_loop`` it is told the wheels' speeds, and its own loop finds the duties, where it has one.
    """

    device: str = Field(default="/dev/ttyACM0", min_length=1)
    baud: int = Field(default=115200, ge=300, le=4_000_000)
    """The speed of the serial line, which the board's program sets."""
    exclusive: bool = True
    """The port is locked, so that no second program reads half of the bytes."""
    dtr: bool = True
    rts: bool = True
    hang_up_on_close: bool = False
    reconnect_delay_s: float = Field(default=0.1, gt=0, le=60)
    """The wait before the port is opened again; it doubles with each attempt."""
    max_reconnect_delay_s: float = Field(default=2.0, gt=0, le=600)
    """The longest wait between two attempts to open the port."""
    reconnect_jitter: float = Field(default=0.2, ge=0, lt=1)
    """Each wait is varied by this share of itself, so that several programs do not try at once."""
    health_after_s: float = Field(default=2.0, gt=1, le=60)
    setpoints_per_s: float = Field(default=200.0, gt=0, le=1000)
    firmware: FirmwareMode = FirmwareMode.AUTO
    """``auto`` agrees on the checked mode with a board that runs our firmware; ``classic`` drives every board
    like a published sketch."""
    deadman_ms: int = Field(default=250, ge=100, le=2000)
    """In the checked mode the board stops by itself when it hears no command for so long."""
    wheel_loop: bool = False
    board_buffer_bytes: int = Field(default=63, ge=32, le=1_000_000)

    @field_validator("device")
    @classmethod
    def _has_a_descriptor(cls, device: str) -> str:
        return check_device(device, "/dev/ttyACM0")

    @model_validator(mode="after")
    def _feeds_the_dead_man(self) -> Self:
        """A single command that is lost must not let the board's dead-man come."""
        least = 4000 / self.deadman_ms
        if self.firmware is FirmwareMode.AUTO and self.setpoints_per_s < least:
            raise ValueError(
                f"setpoints_per_s {self.setpoints_per_s:g} lets a dead-man of {self.deadman_ms} ms come while the robot "
                f"drives: expected at least {least:g}, a longer deadman_ms, or firmware = 'classic'"
            )
        return self


class BriefSerial(serial.Serial):  # type: ignore[misc]
    """A serial port that does not wait for ever for a board that has stopped reading.

    pyserial's ``flush`` waits until the last byte is out, and so does the kernel at ``close``, for up to 30 s.
    """

    def flush(self) -> None:
        """Drop what is unsent: the shutdown stop has had its time. A lost device has nothing to drop."""
        try:
            if self.out_waiting:
                self.reset_output_buffer()
        except (OSError, termios.error):
            log.debug("the device disappeared before all output was written")


class PortTransport(asyncio.Transport):
    """The transport of a port, which can say something in place of what is unsent; this one keeps nothing unsent."""

    def unread_bytes(self) -> int:
        """How many bytes have come in and wait to be read."""
        return 0

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """There is no buffer."""

    def overtake(self, words: bytes) -> None:
        """Write instead of all that is unsent."""
        self.write(words)

    def write_from_thread(self, words: bytes) -> bool:
        """The same past a loop that stands still, from any thread: whether the device took the words."""
        return False

    def close_saying(self, words: bytes) -> None:
        """The same once more, and close when they are sent, or after a while."""
        self.overtake(words)
        self.abort()

    def close_behind(self, words: bytes, *, dtr: bool) -> None:
        """Set or clear DTR, say the words, and close; the loop does not wait for it."""
        self.close_saying(words)


class SerialPortTransport(serial_asyncio.SerialTransport, PortTransport):  # type: ignore[misc]
    """pyserial-asyncio's transport, which reads and writes the device itself while that gives and takes bytes.

    The library's own ``write`` waits for the loop to say that the device is writable, which costs a turn of the
    loop for every motor command; its ``read`` asks the kernel anew what the loop knows; its ``abort`` must not be called
    twice. It closes the device in the loop: the kernel may wait there for a device that takes nothing, and pyserial
    sleeps 0.3 s after each ``socket://``. This one closes in a thread.
    """

    _overtaken = False  # by another thread: what is unsent must not go
    _is_lost = False  # and its device is being closed

    def __init__(
        self, loop: asyncio.AbstractEventLoop, protocol: asyncio.BaseProtocol, port: serial.Serial
    ) -> None:
        super().__init__(loop, protocol, port)  # type: ignore[call-arg, arg-type]  # the library's, which has no types
        self._descriptor: int = port.fileno()  # good for as long as this is not closing

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Write now what the device takes; the rest follows as soon as it takes more."""
        if self._closing:
            return
        if self._overtaken:
            self.flush()
        if not self._write_buffer:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                pass
            except OSError:
                self.abort()
                return
        if data:
            super().write(data)

    def get_write_buffer_size(self) -> int:
        """How many bytes are unsent."""
        return sum(map(len, self._write_buffer)) if self._write_buffer else 0

    def _read_ready(self) -> None:
        try:
            data = os.read(self._descriptor, READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._close(error)
            return
        if data:
            self._protocol.data_received(data)
        else:
            self._close(OSError("the device is ready to read but returned no data: was it unplugged?"))

    def unread_bytes(self) -> int:
        """How many bytes have come in and wait to be read; none from a lost device."""
        try:
            return 0 if self._closing else int(self.serial.in_waiting)
        except (OSError, termios.error):
            return 0

    def overtake(self, words: bytes) -> None:
        """Write instead of all that is unsent, in the kernel too where the driver can drop it.

        That may cut a line short, which ends where the first of the words does.
        """
        if self.get_write_buffer_size() and not self.is_closing():
            self.flush()
            self._drop_in_kernel()
        self.write(words)

    def write_from_thread(self, words: bytes) -> bool:
        """The same past a loop that stands still, from any thread: whether the device took the words.

        The caller sees to it that the port is not closed meanwhile.
        """
        if self.get_write_buffer_size():
            self._overtaken = True
            self._drop_in_kernel()
        try:
            return os.write(self.serial.fileno(), words) == len(words)
        except OSError:
            return False

    def close_saying(self, words: bytes) -> None:
        """The same once more, then close; the loop stands still for ``FLUSH_TIMEOUT_S`` at most."""
        if self.is_closing():
            return
        unsent = self.get_write_buffer_size()
        self.flush()
        try:
            if unsent or not self._sent(words, STALE_S):
                self._drop_in_kernel()
                self._sent(words, FLUSH_TIMEOUT_S)
        except (OSError, termios.error):
            log.debug("the device disappeared before the shutdown stop")
        self.abort()

    def close_behind(self, words: bytes, *, dtr: bool) -> None:
        """Set DTR, say the last words and close, all in a thread: the loop goes on. Then the connection is lost."""
        if self.is_closing():
            return
        self.flush()
        self._closing = True
        self._remove_reader()
        self._loop.run_in_executor(DEVICE_THREADS, self._end_in_thread, self._loop, words, dtr)

    def _end_in_thread(self, loop: asyncio.AbstractEventLoop, words: bytes, dtr: bool) -> None:
        """What ``close_behind`` does; a device that is lost has heard enough."""
        self._set_dtr(dtr)
        try:
            self._sent(words, FLUSH_TIMEOUT_S)
        except (OSError, termios.error):
            log.debug("the device disappeared before its last words")
        with contextlib.suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(self._call_connection_lost, None)

    def _set_dtr(self, state: bool) -> None:
        """Set or clear DTR, where the port has that line; a lost device has none."""
        try:
            self.serial.dtr = state
        except (AttributeError, OSError, termios.error):
            log.debug("the device has no DTR line, or disappeared")

    def _call_connection_lost(self, exc: Exception | None) -> None:
        """Tell the protocol, and close the device in a thread."""
        if self._is_lost:
            return
        self._is_lost = True
        self._write_buffer.clear()
        try:
            self._protocol.connection_lost(exc)
        finally:
            self._loop.run_in_executor(DEVICE_THREADS, _close_port, self.serial)

    def flush(self) -> None:
        """Drop what is unsent here."""
        self._overtaken = False
        super().flush()

    def _write_ready(self) -> None:
        if self._overtaken:
            self.flush()
        else:
            super()._write_ready()

    def _drop_in_kernel(self) -> None:
        try:
            self.serial.reset_output_buffer()
        except (OSError, termios.error):
            log.debug("the device disappeared before all output was written")

    def _sent(self, words: bytes, within_s: float) -> bool:
        """Whether the device accepts the lines and everything is sent in time."""
        give_up_s = time.monotonic() + within_s
        while True:
            with contextlib.suppress(BlockingIOError):
                words = words[os.write(self.serial.fileno(), words) :] if words else words
            if not words and not getattr(self.serial, "out_waiting", 0):  # a socket does not tell
                return True
            if time.monotonic() >= give_up_s:
                return False
            time.sleep(LOOK_S)

    def abort(self) -> None:
        """Close now, dropping what is unsent; harmless on a closed transport."""
        if not self.is_closing():
            super().abort()


class CannotOpen(OSError):
    """A device cannot be opened; ``why`` says so without its name."""

    def __init__(self, device: str, why: str) -> None:
        super().__init__(f"{device}: {why}")
        self.why = why


async def open_port(parameters: LinkParameters, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
    """Open the device and connect ``protocol`` to it.

    Raises:
        OSError: the device is missing, busy or not a serial port; the message names it.
    """
    loop = asyncio.get_running_loop()
    port = await loop.run_in_executor(DEVICE_THREADS, _open, parameters)
    return SerialPortTransport(loop, protocol, port)


def _close_port(port: serial.Serial) -> None:
    """Close in a thread; what is unsent is dropped, and a lost device has nothing to close."""
    try:
        port.flush()
        port.close()
    except (OSError, termios.error, AttributeError):
        log.debug("the device disappeared before it was closed")


def _open(parameters: LinkParameters) -> Any:
    """Open in a thread: a tty may take its time, and ``socket://`` always does."""
    device = parameters.device
    try:
        if "://" in device:
            return serial.serial_for_url(device)
        return _open_tty(parameters)
    except (ValueError, termios.error) as error:  # the latter when the cable is pulled meanwhile
        raise OSError(f"{device}: {error}") from error
    except OSError as error:
        # what looks through all ports and processes: only where one fails
        from chefbotd.link.cannot_open import advice, owner_of

        in_use = error.errno in IN_USE
        reason = (
            Sentence("board.in_use", "in use by {owner}", owner=owner_of(device))
            if in_use
            else advice(device, error)
        )
        raise CannotOpen(device, reason) from error


def _open_tty(parameters: LinkParameters) -> "BriefSerial":
    port = BriefSerial(baudrate=parameters.baud, exclusive=parameters.exclusive or None)
    port.dtr, port.rts = parameters.dtr, parameters.rts
    port.port = parameters.device
    with hand_over(parameters.device):
        port.open()
    try:
        _keep_hang_up(port.fileno(), parameters.hang_up_on_close)
    except termios.error:
        port.close()
        raise
    return port


def _keep_hang_up(descriptor: int, hang_up: bool) -> None:
    settings = termios.tcgetattr(descriptor)
    control = settings[2]
    settings[2] = control | termios.HUPCL if hang_up else control & ~termios.HUPCL
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)
