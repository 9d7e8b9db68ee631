"""The simulated board as a process of its own: a device to open, and one-word commands to play with it."""

import asyncio
import json
import math
import os
import signal
import sys
import threading
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from pathlib import Path

from msgspec.structs import asdict

from chefbotd.clock import SystemClock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.parameters.sketches import SketchName
from chefbotd.components.simulation.pty import PluggedLidars, PtyBoard
from chefbotd.components.simulation.simulation import Simulation, board_sender, build_launchpad

Say = Callable[[str], None]
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
MAX_WORD_BYTES = 64

MOST_BEHIND_S = 0.05
"""Of an emulated processor: a busy computer may not emulate it in real time, and one that tries is ever later."""


def say_on_stdout(line: str) -> None:
    """Print a line without buffering, so that the reader of a pipe gets it at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


async def simulate(
    simulation: Simulation,
    *,
    link_path: Path | None = None,
    seed: int | None = None,
    as_json: bool = False,
    commands: AsyncIterator[str] | None = None,
    say: Say = say_on_stdout,
) -> None:
    """Run a simulated board until ``quit``, SIGINT or SIGTERM; the first line said is the device's path.

    A line for each of the robot's lidars comes next, in the order of the configuration.

    Args:
        simulation: what to simulate.
        link_path: a symbolic link to keep pointed at the device; removed at the end. A lidar's is beside it, with its
            name behind a hyphen.
        seed: stands in for the configured one.
        as_json: say JSON objects instead of plain lines.
        commands: one word each (``unplug``, ``plug``, ``truth``, ``reset``, ``quit``); default: the lines of
            stdin. Their end does not end the run.
        say: takes each line of output.

    Raises:
        OSError: the map cannot be read, or the device or its link cannot be made.
        ValueError: the map is none, or the start pose is too close to a wall.
    """
    session = SimulateRun(simulation, link_path, seed, as_json, say)
    loop = asyncio.get_running_loop()
    for number in STOP_SIGNALS:
        loop.add_signal_handler(number, session.quit)
    try:
        await session.run(stdin_lines() if commands is None else commands)
    finally:
        for number in STOP_SIGNALS:
            loop.remove_signal_handler(number)


class SimulateRun:
    """One run of the program: a board on a pseudo-terminal, and the words it obeys."""

    def __init__(
        self,
        simulation: Simulation,
        link_path: Path | None,
        seed: int | None,
        as_json: bool,
        say: Say,
    ) -> None:
        self._pty = PtyBoard(lambda data: self._runner.receive(data), link_path)
        send = board_sender(simulation, self._pty.send, lambda: self._pty.host)
        emulated = simulation.parameters.board.sketch is SketchName.EMULATED
        self._runner = BoardRunner(
            build_launchpad(simulation, seed),
            send,
            SystemClock(),
            most_behind_s=MOST_BEHIND_S if emulated else math.inf,
        )
        self._lidars = PluggedLidars(simulation, self._runner, SystemClock(), link_path, seed)
        self._as_json, self._say_line = as_json, say
        self._done = asyncio.Event()
        self._words = {
            "plug": self.plug_cable,
            "unplug": self.unplug_cable,
            "truth": self.print_truth,
            "reset": self.reset,
            "quit": self.quit,
        }

    async def run(self, commands: AsyncIterator[str]) -> None:
        """Plug in, run and obey until told to quit; unplugs on every way out."""
        try:
            self.plug_cable()
            for name, device in self._lidars.plug().items():
                self._say({"lidar": name, "device": str(device)}, "device")
            async with asyncio.TaskGroup() as tasks:
                loops = (self._runner.run(), self._lidars.run(), self._obey_words(commands))
                running = [tasks.create_task(loop) for loop in loops]
                await self._done.wait()
                for task in running:
                    task.cancel()
        finally:
            self._lidars.unplug()
            self._pty.unplug()

    async def _obey_words(self, commands: AsyncIterator[str]) -> None:
        async for line in commands:
            word = line.strip()
            if word in self._words:
                self._words[word]()
            elif word:
                words = " ".join(self._words)
                self._say({"error": f"unknown word {word!r}, expected one of: {words}"}, "error")

    def plug_cable(self) -> None:
        """Connect the cable, and say the path of the device."""
        self._say({"device": str(self._pty.plug())}, "device")

    def unplug_cable(self) -> None:
        """Pull the cable; the board runs on."""
        self._pty.unplug()
        self._say({"unplugged": True})

    def print_truth(self) -> None:
        """Say where the robot really is, always as JSON, and what its motors get, with times by the board's clock."""
        truth, runner = self._runner.truth(SystemClock().now_s()), self._runner
        moved = {**asdict(truth.world_from_base), **asdict(truth.twist), "in_contact": truth.in_contact}
        times = {
            "board_s": runner.board_s(),
            "duty_since_s": runner.duty_since_s,
            "heard_s": runner.heard_s,
        }
        self._say_line(json.dumps({**moved, "duty": runner.duty, **times}))

    def reset(self) -> None:
        """Send the board the reset command, as a host would."""
        self._runner.receive(b"r\r")
        self._say({"reset": True})

    def quit(self) -> None:
        """End the run."""
        self._done.set()

    def _say(self, answer: dict[str, str | bool], plain: str | None = None) -> None:
        """Say an answer; as plain text the value called ``plain``, or its one key when there is none."""
        text = next(iter(answer)) if plain is None else str(answer[plain])
        self._say_line(json.dumps(answer) if self._as_json else text)


async def stdin_lines() -> AsyncGenerator[str, None]:
    """The lines of stdin, be it a terminal, a pipe, a file or closed: read by a thread of its own."""
    loop, lines = asyncio.get_running_loop(), asyncio.Queue[str | None]()

    def pass_on(line: str | None) -> bool:
        if not loop.is_closed():
            loop.call_soon_threadsafe(lines.put_nowait, line)
        return not loop.is_closed()

    threading.Thread(target=_read_lines, args=(pass_on,), name="stdin", daemon=True).start()
    while (line := await lines.get()) is not None:
        yield line


def _read_lines(pass_on: Callable[[str | None], bool]) -> None:
    """Read until the end, or until nobody listens any more.

    Reads descriptor 0 itself: a buffered reader's lock, held here at exit, would abort the interpreter.
    """
    pending = b""
    while data := _read_some():
        *whole, pending = (pending + data).split(b"\n")
        pending = pending[-MAX_WORD_BYTES:]
        if not all(pass_on(line.decode(errors="replace")) for line in whole):
            return
    pass_on(None)


def _read_some() -> bytes:
    try:
        return os.read(0, 4096)
    except OSError:  # stdin is closed
        return b""
