"""One run of the doctor: its options, its way to ask questions, and its findings so far."""

import asyncio
import contextlib
import os
import threading
from collections.abc import Callable
from typing import Protocol

from msgspec import Struct, field

from chefbotd.cli.common.echo import tell
from chefbotd.clock import Clock
from chefbotd.components.doctor.algorithms.finding import Finding
from chefbotd.components.doctor.algorithms.wheels import WheelSetting
from chefbotd.link.reconnect import Opener
from chefbotd.settings import Settings

YES = "yes"
"""Nothing moves unless this word was typed, whole."""


class Asker(Protocol):
    """Somebody to ask."""

    async def ask(self, question: str) -> str | None:
        """The answer, without spaces around it; None where nobody is there."""
        ...


class NoAnswers:
    """Nobody is asked."""

    async def ask(self, question: str) -> str | None:
        """No answer."""
        return None


class TerminalAsker:
    """Asks on stderr, and reads the answer from standard input, be it a terminal or a pipe; its end is nobody."""

    def __init__(self) -> None:
        self._lines: asyncio.Queue[str | None] = asyncio.Queue()
        self._reader: threading.Thread | None = None
        self._gone = False

    async def ask(self, question: str) -> str | None:
        """What was typed before the question does not count as its answer, on a terminal."""
        if self._gone:
            return None
        self._drop_early_answers()
        tell(f"\n{question}\n> ", line_end=False)
        if self._reader is None:
            loop = asyncio.get_running_loop()
            self._reader = threading.Thread(target=self._read, args=(loop,), name="stdin", daemon=True)
            self._reader.start()
        line = await self._lines.get()
        self._gone = line is None
        return None if line is None else line.strip()

    def _drop_early_answers(self) -> None:
        while os.isatty(0) and not self._lines.empty():
            self._lines.get_nowait()

    def _read(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read lines until the end. Reads descriptor 0 itself: a buffered reader's lock would hold up the exit."""
        pending = b""
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody listens any more
            while data := _read_some():
                *lines, pending = (pending + data).split(b"\n")
                for line in lines:
                    loop.call_soon_threadsafe(self._lines.put_nowait, line.decode(errors="replace"))
            loop.call_soon_threadsafe(self._lines.put_nowait, None)


def _read_some() -> bytes:
    try:
        return os.read(0, 4096)
    except OSError:  # stdin is closed
        return b""


Report = Callable[[Finding], None]


class Diagnosis(Struct):
    """``seconds`` is how long the robot is listened to; with ``motors`` the wheels may be driven, once asked.

    ``wanted_device`` is the board's device if the user named one.
    """

    settings: Settings
    asker: Asker
    report: Report
    opener: Opener
    clock: Clock
    seconds: float = 5.0
    motors: bool = False
    wanted_device: str | None = None
    findings: list[Finding] = field(default_factory=list)

    def find(self, *findings: Finding) -> None:
        """Keep and report findings, in the order of the walk."""
        for finding in findings:
            self.findings.append(finding)
            self.report(finding)

    @property
    def wheels(self) -> list[WheelSetting]:
        """The wheels as they are configured."""
        chassis = self.settings.chassis
        return [
            WheelSetting(
                wheel.name, wheel.side.value == "left", wheel.radius_m, wheel.motor_sign, wheel.encoder_sign
            )
            for wheel in chassis.wheels
        ]
