"""Flashing a board: stop it, write and verify its new program, and hear what it says.

A write that fails is tried again, and the error after the last try says what state the board is in.
"""

import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import serial

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.flash.boards import CommandLine, Programmer
from chefbotd.core.record import Record
from chefbotd.link.wires import stop_line

BAUD = 115_200
STOP_S = 1.5
"""A classic sketch's cycle takes up to a second where no echo comes back (docs/protocol.md), and tells its duty then."""

TRIES = 3
PROGRAM_TIMEOUT_S = 180.0
HEAR_S = 8.0
"""The boot loader waits up to 2 s, the classic boards take as long to start, and ours names itself once a second."""

NAME, DUTY = b"firmware", b"s"

Tell = Callable[[str], None]


class FlashedBoard(Record, frozen=True):
    """What the board said after it was flashed: our firmware's version (empty: it did not name itself), a first line."""

    version: str = ""
    line: str = ""


def stop_motors(port: SerialPort, tell: Tell) -> None:
    """Write a stop, and wait until the board's echo shows it, ``STOP_S`` at most.

    A LaunchPad whose processor is halted keeps its motors as they are, and a classic sketch that waits for its
    ultrasonic sensor reads its input once a second.

    Raises:
        ProgramError: the port cannot be opened or written.
    """
    duty: tuple[float, ...] = ()
    try:
        with serial.Serial(port.device, BAUD, timeout=0.2, write_timeout=2.0, exclusive=True) as line:
            line.reset_input_buffer()
            line.write(2 * stop_line("classic"))
            line.flush()
            for number, text in enumerate(_lines(line, STOP_S)):
                duty = (number > 0 and duty_in(text)) or duty  # the first may be the end of another line
                if duty and not any(duty):
                    return
    except (OSError, serial.SerialException) as error:
        raise ProgramError(Exit.FAILED, f"{port.device}: cannot be told to stop: {error}") from error
    if duty:
        tell(f"The board does not confirm the stop: it reports duty {duty}. Its wheels may turn meanwhile.")


def write(programmer: Programmer, port: SerialPort, image: Path, go_back: str, tell: Tell) -> None:
    """Write and verify, up to three times.

    Raises:
        ProgramError: no try succeeded; it says what state the board is in.
    """
    try:
        run_again(programmer.write(port, image), "Writing", tell)
    except ProgramFailed as failure:
        raise ProgramError(
            Exit.FAILED,
            f"the board was not programmed: {failure}. It may hold half a program, which may do anything: keep the "
            "wheels off the ground. Its boot loader or debugger is not touched by this, so run the command again. "
            f"{go_back}",
        ) from failure


def run_again(command: Sequence[str], what: str, tell: Tell) -> None:
    """Run a programmer, up to three times: a boot loader may have missed the reset, or a byte.

    Raises:
        ProgramFailed: no try succeeded; of the last one.
    """
    for attempt in range(1, TRIES + 1):
        try:
            run(command)
        except ProgramFailed as error:
            tell(f"{what} failed (try {attempt} of {TRIES}): {error}")
            if attempt == TRIES:
                raise
        else:
            return


class ProgramFailed(Exception):
    """A program that ended with an error, or not at all; the message has its last line."""


def run(command: Sequence[str]) -> None:
    """Run a programmer in a session of its own: an interrupt typed at the terminal does not cut a write in half.

    Nor does the end of this program, or of its terminal: what the programmer says goes to a file, as it would end
    itself at a pipe that nobody reads.

    Raises:
        ProgramFailed: it failed, or did not end within ``PROGRAM_TIMEOUT_S``.
    """
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(  # noqa: S603 - the arguments are ours, and no shell reads them
            command, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT, start_new_session=True
        )
        until_s = time.monotonic() + PROGRAM_TIMEOUT_S
        interrupted = False
        while True:
            try:
                process.wait(timeout=max(until_s - time.monotonic(), 0.0))
                break
            except KeyboardInterrupt:
                interrupted = True  # the board first
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                raise ProgramFailed(f"{command[0]} did not end within {PROGRAM_TIMEOUT_S:.0f} s") from None
        said.seek(0)
        output = said.read()
    if process.returncode:
        lines = [line.strip() for line in output.decode(errors="replace").splitlines() if line.strip()]
        last = f": {lines[-1]}" if lines else ""
        raise ProgramFailed(f"{command[0]} ended with exit code {process.returncode}{last}")
    if interrupted:
        raise KeyboardInterrupt


def hear(port: SerialPort, *, is_ours: bool) -> FlashedBoard:
    """Open the port and listen until the firmware names itself (any line, if it is not ours), or ``HEAR_S`` is over.

    Raises:
        ProgramError: the port cannot be opened or read.
    """
    first = ""
    try:
        with serial.Serial(port.device, BAUD, timeout=0.2, exclusive=True) as line:
            for text in _lines(line, HEAR_S):
                if version := version_in(text):
                    return FlashedBoard(version, text.decode(errors="replace"))
                first = first or text.decode(errors="replace")
                if first and not is_ours:
                    break
    except (OSError, serial.SerialException) as error:
        raise ProgramError(
            Exit.FAILED, f"{port.device}: was flashed, but cannot be listened to: {error}"
        ) from error
    return FlashedBoard(line=first)


def _lines(line: serial.Serial, for_s: float) -> Iterator[bytes]:
    """What comes in for so long, line by line; the first may be the end of one."""
    until_s, pending = time.monotonic() + for_s, b""
    while time.monotonic() < until_s:
        *lines, pending = (pending + line.read(max(line.in_waiting, 1))).split(b"\n")
        yield from (text.strip() for text in lines)


def duty_in(line: bytes) -> tuple[float, ...]:
    """The duty of both wheels in the line by which a board tells it, in either mode; empty in any other."""
    kind, *fields = line.split(b"\t")
    try:
        return (float(fields[0]), float(fields[1])) if kind == DUTY else ()
    except (IndexError, ValueError):
        return ()


def version_in(line: bytes) -> str:
    """The version in the line by which our firmware names itself; empty in any other."""
    kind, *fields = line.split(b"\t")
    if kind != NAME or len(fields) < 3 or not all(field.isdigit() for field in fields):
        return ""
    return f"{int(fields[1])}.{int(fields[2])}"


def format_command(command: CommandLine) -> str:
    """A command as it would be typed."""
    return shlex.join(command)
