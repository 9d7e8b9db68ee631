"""The program that a board had before it was flashed: kept in a file, which is the way back.

While a board is written, a marker in the same folder names that file. It stays where the write does not succeed: what
the board holds then is half a program, and no way back.
"""

import errno
import os
import shutil
from datetime import datetime
from pathlib import Path

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.flash.boards import Board, Programmer
from chefbotd.components.flash.procedure import ProgramFailed, Tell, run_again
from chefbotd.storage import explain, sync_folder

ERASED = 0xFF


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
        run_again(programmer.read(port, unfinished), "Reading the old program", tell)
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


def begin_write(
    board: Board, port: SerialPort, folder: Path, kept: Path | None, tell: Tell
) -> tuple[Path, Path | None]:
    """Mark the board as not whole; gives the marker, which is to be removed when it is, and the file to go back with.

    That is the one from before an earlier write which did not succeed, if there was one.

    Raises:
        ProgramError: the marker cannot be written. Nothing has been written to the board.
    """
    serial_number = "".join(filter(str.isalnum, port.serial_number or ""))
    marker = folder / f"{'-'.join(filter(None, (board.name, serial_number)))}.unfinished"
    try:
        if marker.exists():
            name = marker.read_text()
            kept = Path(name) if name and Path(name).is_file() else None
            tell(
                "An earlier write to this board did not succeed: the way back is the program from before it."
            )
            return marker, kept
        folder.mkdir(parents=True, exist_ok=True)
        with marker.open("w") as file:
            file.write("" if kept is None else str(kept))
            file.flush()
            os.fsync(file.fileno())
        sync_folder(folder)
    except OSError as error:
        raise ProgramError(
            Exit.FAILED, f"{marker}: cannot be written, so the board was not: {explain(error)}"
        ) from error
    return marker, kept


def way_back(board: Board, port: SerialPort, kept: Path | None) -> str:
    """How to have the old program on the board again."""
    if kept is None:
        return "To go back, upload the classic sketch with its own tools (Energia, Arduino IDE)."
    return f"To go back: chefbotctl flash --board {board.name} --port {port.device} --image {kept}"
