"""Flashing a board: stop it, keep its old program, write and verify the new one, and hear what it says.

A write that fails is tried again, and the error after the last try says what state the board is in.
"""

import errno
import os
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import serial

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.flash.boards import Board, CommandLine, Programmer
from chefbotd.core.record import Record
from chefbotd.doctor.listening.ports import SerialPort
from chefbotd.storage import explain, sync_folder

BAUD = 115_200
STOP = b"s 0 0\r"
WRITES = 3
PROGRAM_TIMEOUT_S = 180.0
HEAR_S = 8.0
"""The boot loader waits up to 2 s, the classic boards take as long to start, and ours names itself once a second."""

ERASED = 0xFF
NAME = b"firmware"

Tell = Callable[[str], None]


class Heard(Record, frozen=True):
    """What the board said after it was flashed: our firmware's version (empty: it did not name itself), a first line."""

    version: str = ""
    line: str = ""


def stop_motors(port: SerialPort) -> None:
    """Write a stop twice: a LaunchPad whose processor is halted keeps its motors as they are.

    Raises:
        ProgramError: the port cannot be opened or written.
    """
    try:
        with serial.Serial(port.device, BAUD, timeout=0.2, write_timeout=2.0, exclusive=True) as line:
            line.write(STOP * 2)
            line.flush()
            line.read(
                4096
            )  # until the board is silent for a moment, or has talked: it has read the stop by then
    except (OSError, serial.SerialException) as error:
        raise ProgramError(Exit.FAILED, f"{port.device}: cannot be told to stop: {error}") from error


def keep_old_program(
    programmer: Programmer, port: SerialPort, board: Board, folder: Path, now: datetime, tell: Tell
) -> Path | None:
    """Read the board's program into a new file; None where the programmer cannot read, or there is none.

    Raises:
        ProgramError: it cannot be read or kept. Nothing has been written to the board.
    """
    if programmer.read is None:
        tell(f"{programmer.program} cannot read the old program: it is not kept (openocd can).")
        return None
    kept = folder / f"{board.name}-{now:%Y%m%d-%H%M%S}.bin"
    unfinished = kept.with_suffix(".part")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(folder).free < 2 * board.kept_bytes:  # not every programmer says that it ran out
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        run(programmer.read(port, unfinished))
        data = unfinished.read_bytes()[: board.kept_bytes].rstrip(bytes([ERASED]))
        if not data:
            tell("The board's flash memory is empty: there is no old program to keep.")
            return None
        with unfinished.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(kept)
        sync_folder(folder)
    except ProgramFailed as error:
        raise ProgramError(
            Exit.FAILED, f"the old program cannot be read, so nothing was written: {error}"
        ) from error
    except OSError as error:
        raise ProgramError(
            Exit.FAILED, f"{kept}: the old program cannot be kept: {explain(error)}"
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)
    tell(f"The old program is kept in {kept} ({len(data)} bytes).")
    return kept


def write(programmer: Programmer, port: SerialPort, image: Path, go_back: str, tell: Tell) -> None:
    """Write and verify, up to three times.

    Raises:
        ProgramError: no try succeeded; it says what state the board is in.
    """
    for attempt in range(1, WRITES + 1):
        try:
            run(programmer.write(port, image))
        except ProgramFailed as error:
            tell(f"Writing failed (try {attempt} of {WRITES}): {error}")
            failure = error
        else:
            return
    raise ProgramError(
        Exit.FAILED,
        f"the board was not programmed: {failure}. It may hold half a program, and does not drive until it is flashed: "
        f"its boot loader or debugger is not touched by this, so run the command again. {go_back}",
    )


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


def hear(port: SerialPort, *, is_ours: bool) -> Heard:
    """Open the port and listen until the firmware names itself (any line, if it is not ours), or ``HEAR_S`` is over.

    Raises:
        ProgramError: the port cannot be opened or read.
    """
    first = ""
    until_s = time.monotonic() + HEAR_S
    try:
        with serial.Serial(port.device, BAUD, timeout=0.2, exclusive=True) as line:
            pending = b""
            while time.monotonic() < until_s:
                *lines, pending = (pending + line.read(max(line.in_waiting, 1))).split(b"\n")
                for text in (part.strip() for part in lines):
                    if version := version_in(text):
                        return Heard(version, text.decode(errors="replace"))
                    first = first or text.decode(errors="replace")
                if first and not is_ours:
                    break
    except (OSError, serial.SerialException) as error:
        raise ProgramError(
            Exit.FAILED, f"{port.device}: was flashed, but cannot be listened to: {error}"
        ) from error
    return Heard(line=first)


def version_in(line: bytes) -> str:
    """The version in the line by which our firmware names itself; empty in any other."""
    kind, *fields = line.split(b"\t")
    if kind != NAME or len(fields) < 3 or not all(field.isdigit() for field in fields):
        return ""
    return f"{int(fields[1])}.{int(fields[2])}"


def way_back(board: Board, port: SerialPort, kept: Path | None) -> str:
    """How to have the old program on the board again."""
    if kept is None:
        return "To go back, upload the classic sketch with its own tools (Energia, Arduino IDE)."
    return f"To go back: chefbotctl flash --board {board.name} --port {port.device} --image {kept}"


def shown(command: CommandLine) -> str:
    """A command as it would be typed."""
    return shlex.join(command)
