"""Keeps the gate's state in a file, so that an e-stop or a fault outlives a daemon that is killed or crashes.

A few bytes are written whenever the mode changes, after the stop is on the wire and before its caller has the answer.
The file belongs in memory (tmpfs, as /run is), for the loop waits until it is written.
"""

import contextlib
from pathlib import Path
from urllib.parse import quote

import structlog

from chefbotd.safety import latch
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import GateState, Mode
from chefbotd.safety.latch import LatchParameters
from chefbotd.storage import create_file, read_file

log = structlog.get_logger(component="safety")

MAX_BYTES = 65536


def path_of(parameters: LatchParameters, robot: str, *, simulated: bool) -> Path | None:
    """The path for a robot's name. A simulated robot has another one: its ``arm`` must not arm the real robot."""
    if parameters.folder is None:
        return None
    kind = "simulated" if simulated else "robot"
    return parameters.folder / f"{kind}-{quote(robot, safe='')}.json"


class LatchFile:
    """Never raises for a file that cannot be read or written; without a ``path`` it does nothing.

    A disk that has become full still takes a state in place of the old one: a power cut in that moment leaves a file
    that cannot be read, and the next daemon begins disarmed.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._state: GateState | None = None
        self._written = b""
        self._complained = False

    def recall(self) -> GateState:
        """The state to begin in: that of the last daemon, or disarmed if the file cannot be read."""
        state = GateState() if self._path is None else _read(self._path)
        if state.mode is Mode.ARMED and (problem := self._why_not_writable()):
            state = latch.unwritable(problem)
        if state.mode is not Mode.ARMED:
            log.warning(
                "starting in the state in which the last daemon ended"
                if state.fault is not FaultKind.LATCH_UNWRITABLE
                else "starting disarmed: the latch file cannot be written",
                mode=str(state.mode),
                fault=state.fault,
                reason=state.reason,
            )
        return state

    def keep(self, state: GateState) -> str:
        """Write this state, unless the file has it already. Why it cannot be written; empty: it is there."""
        self._state = state
        text = latch.write(state)
        if self._path is None or text == self._written:
            return ""
        try:
            _write(self._path, text)
        except OSError as error:
            self._complain(
                "the latch file cannot be written: a restart may forget an e-stop or a fault", error
            )
            return str(error)
        self._written = text
        return ""

    def _why_not_writable(self) -> str:
        """Why a state could not be stored now; empty: it could. What is there stays as it is."""
        if self._path is None:
            return ""
        probe = self._path.with_suffix(".probe")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with create_file(probe) as file:
                file.write(latch.write(GateState()))
        except OSError as error:
            self._complain("the latch file cannot be written: the robot is not armed", error)
            return str(error)
        finally:
            with contextlib.suppress(OSError):  # there is none where it could not be written
                probe.unlink(missing_ok=True)
        return ""

    def end(self) -> None:
        """The daemon ends in order: remove the file of an armed robot; any other state stays."""
        if self._path is None or self._state is None or self._state.mode is not Mode.ARMED:
            return
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            self._complain("the latch file cannot be removed: the next start will be disarmed", error)

    def _complain(self, event: str, error: OSError) -> None:
        if not self._complained:
            log.warning(event, path=str(self._path), error=str(error))
        self._complained = True


def _write(path: Path, text: bytes) -> None:
    """Replace the file as a whole; where there is no room for another one, write into it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    try:
        with create_file(new) as file:
            file.write(text)
        new.replace(path)
    except OSError:
        with contextlib.suppress(OSError):  # its room is needed
            new.unlink(missing_ok=True)
        if not path.is_file():
            raise
        with path.open("r+b") as file:
            file.write(text)
            file.truncate()


def _read(path: Path) -> GateState:
    try:
        return latch.read(read_file(path, MAX_BYTES))
    except FileNotFoundError:
        return GateState()
    except (OSError, ValueError, RecursionError) as error:
        log.warning("the latch file cannot be read: starting disarmed", path=str(path), error=str(error))
        return latch.UNREADABLE
