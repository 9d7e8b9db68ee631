"""One run of a program: what is to be run, what became of it, and the process in which it runs."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import msgspec

from chefbotd.cli.common.exits import Exit, ProgramError

LOOKS_S: Final = 1.0
"""How often a run looks whether the sweep was ended."""

LAST_LINE: Final = 200


class Job(msgspec.Struct, frozen=True):
    """A program (a module's name, or the text of a file called that), a world, a seed, and the limits of a run."""

    program: str
    source: str | None
    world: str
    seed: int
    limit_s: float
    patience_s: float


class Outcome(msgspec.Struct, frozen=True):
    """How a run ended.

    ``end`` is ``done``; ``failed`` (the program raised an error); ``timed_out`` in the simulation; ``crashed`` (its
    process died); ``hung`` (its process took too long); or ``cancelled``. ``text`` is what it returned, or why.
    """

    world: str
    seed: int
    end: str
    text: str
    simulated_s: float | None
    took_s: float


def checked_program(program: str) -> tuple[str, str | None]:
    """The program's name, and its text where it is a file.

    Raises:
        ProgramError: there is no such file or module.
    """
    path = Path(program)
    if path.suffix == ".py":
        try:
            source = path.read_text(encoding="utf-8")
            compile(source, program, "exec")
        except (OSError, UnicodeDecodeError) as error:
            raise ProgramError(Exit.USAGE, f"cannot read {program}: {error}") from error
        except (SyntaxError, ValueError) as error:
            raise ProgramError(Exit.USAGE, f"{program} is no Python program: {error}") from error
        return path.name, source
    with contextlib.suppress(ImportError, ValueError):
        if find_spec(program) is not None:
            return program, None
    raise ProgramError(
        Exit.USAGE, f"there is no module {program!r}, and no file, whose name would end in .py"
    )


def run_job(job: Job, is_cancelled: Callable[[], bool]) -> Outcome:
    """Run it in a process of its own, which is killed when its time is over or the sweep is ended."""
    began_s = time.monotonic()
    with (
        tempfile.TemporaryDirectory(prefix="chefbot-sweep-") as folder,
        (Path(folder) / "log").open("w+b") as log,
    ):
        result = Path(folder) / "outcome.json"
        process = subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-m", "chefbot_devtools.child", str(result)],
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            start_new_session=True,  # Ctrl-C reaches only us, and whatever it starts ends with it
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(Path.cwd()), *sys.path])},
        )
        try:
            assert process.stdin is not None  # noqa: S101 - a pipe
            with contextlib.suppress(BrokenPipeError), process.stdin:
                process.stdin.write(msgspec.json.encode(job))
            end = _wait(process, began_s + job.patience_s, is_cancelled)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        took_s = time.monotonic() - began_s
        if not end and result.exists():
            return msgspec.json.decode(result.read_bytes(), type=Outcome)
        reasons = {
            "hung": f"it was not done after {job.patience_s:g} s of real time",
            "cancelled": "the sweep was ended",
        }
        reason = reasons.get(end) or f"{_death(process.returncode)}; {_last_line(log.fileno())}"
        return Outcome(job.world, job.seed, end or "crashed", reason, None, took_s)


def _wait(process: "subprocess.Popen[bytes]", due_s: float, is_cancelled: Callable[[], bool]) -> str:
    """Until it has ended; else why no longer."""
    while True:
        left_s = due_s - time.monotonic()
        if left_s <= 0:
            return "hung"
        try:
            process.wait(min(LOOKS_S, left_s))
        except subprocess.TimeoutExpired:
            if is_cancelled():
                return "cancelled"
        else:
            return ""


def _death(code: int) -> str:
    if code >= 0:
        return f"its process ended with exit code {code}"
    return f"its process was ended by {signal.Signals(-code).name}"


def _last_line(log: int) -> str:
    """The last that it printed."""
    size = os.fstat(log).st_size
    lines = os.pread(log, 4096, max(0, size - 4096)).decode(errors="replace").strip().splitlines()
    return f"it last printed: {lines[-1][:LAST_LINE]}" if lines else "it printed nothing"
