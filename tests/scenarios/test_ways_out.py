"""Every way out of the real program on a real pty: what is the last thing that the board hears.

The daemon runs as a process of its own, started as users start it; some ways out need a fault, which a few lines of
Python before the start put in.
"""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from chefbotd.client import CallError, Client
from chefbotd.sim.pty import PtyBoard

PATIENCE_S = 15.0
CYCLE_S = 0.02
STOP = b"s 0 0"

BLOCKED = "import time; robot.WiredRobot.stats = lambda self: time.sleep(1.0)"
OUT_OF_MEMORY = "robot.WiredRobot.stats = lambda self: bytearray(1 << 60)"
BROKEN_SERVICE = """
from chefbotd.services import odometry
async def broken(self): raise RuntimeError("broken")
odometry.OdometryService.run = broken
"""


@dataclass
class Board:
    """A pty board that counts as if its wheels obeyed, and keeps every line that it hears with the time."""

    heard: list[tuple[float, bytes]] = field(default_factory=list)
    _rest: bytes = b""
    _travel: float = 0.0

    def hear(self, data: bytes) -> None:
        """Bytes from the daemon."""
        *lines, self._rest = (self._rest + data).split(b"\r")
        self.heard += [(time.monotonic(), line) for line in lines]

    @property
    def last(self) -> bytes:
        """The command now in force."""
        return self.heard[-1][1] if self.heard else b""

    async def live(self, pty: PtyBoard) -> None:
        """Report cycles until cancelled."""
        started_s = time.monotonic()
        while True:
            micros = int((time.monotonic() - started_s) * 1e6)
            self._travel += 1.0 if self.last not in (b"", STOP) else 0.0
            counts = int(self._travel * 40)
            pty.send(b"t\t%d\t%.2f\ne\t%d\t%d\n" % (micros, CYCLE_S, counts, counts))
            await asyncio.sleep(CYCLE_S)


@dataclass
class Running:
    """The daemon's process, its board, a client that drives, and its log."""

    process: asyncio.subprocess.Process
    board: Board
    client: Client
    log: Path

    async def ended(self) -> int:
        """Its exit code."""
        async with asyncio.timeout(PATIENCE_S):
            code = await self.process.wait()
        await asyncio.sleep(2 * CYCLE_S)
        return code


@asynccontextmanager
async def running(folder: Path, fault: str = "") -> AsyncIterator[Running]:
    """Start the daemon with a fault in it, and drive until it moves."""
    board, link, log = Board(), folder / "board", folder / "log"
    pty = PtyBoard(board.hear, link)
    pty.plug()
    living = asyncio.create_task(board.live(pty))
    port = _free_port()
    program = f"from chefbotd import robot\n{fault}\nfrom chefbotd.cli.daemon import main\nmain()"
    arguments = ("run", "--port", str(link), "--listen", f"127.0.0.1:{port}")
    with log.open("wb") as sink:
        process = await asyncio.create_subprocess_exec(sys.executable, "-c", program, *arguments, stderr=sink)
    try:
        async with asyncio.timeout(PATIENCE_S), await _connected(port) as client:
            await _drive_until_it_moves(client, board)
            yield Running(process, board, client, log)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
        living.cancel()
        await asyncio.gather(living, return_exceptions=True)
        pty.unplug()


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


async def _connected(port: int) -> Client:
    while True:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
        except ConnectionRefusedError:
            await asyncio.sleep(0.05)
        else:
            return Client.connect("127.0.0.1", port)


async def _drive_until_it_moves(client: Client, board: Board) -> None:
    while board.last in (b"", STOP):
        try:
            await client.drive(0.2, 0.0)
        except CallError as refusal:
            if refusal.kind != "link_down":
                raise
        await asyncio.sleep(CYCLE_S)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_ends_with_a_stop(tmp_path: Path, number: signal.Signals):
    """In mid-drive: zeros are the last line, and the exit code is 0."""

    async def scenario() -> None:
        async with running(tmp_path) as daemon:
            os.kill(daemon.process.pid, number)
            assert await daemon.ended() == 0
            assert daemon.board.last == STOP

    asyncio.run(scenario())


def test_out_of_memory_in_a_request_stops_nothing(tmp_path: Path):
    """The request gets an error, the robot drives on, and a signal still ends with a stop."""

    async def scenario() -> None:
        async with running(tmp_path, OUT_OF_MEMORY) as daemon:
            with pytest.raises(CallError) as refusal:
                await daemon.client.get_stats()
            assert refusal.value.kind == "internal"
            await daemon.client.drive(0.2, 0.0)
            await asyncio.sleep(CYCLE_S)
            assert daemon.board.last != STOP
            daemon.process.terminate()
            assert await daemon.ended() == 0
            assert daemon.board.last == STOP

    asyncio.run(scenario())


def test_a_blocked_loop_is_stopped_by_the_watchdog(tmp_path: Path):
    """A request that keeps the loop for 1 s: zeros within 0.25 s and a look, and disarmed when the loop is back."""

    async def scenario() -> None:
        async with running(tmp_path, BLOCKED) as daemon:
            asked_s = time.monotonic()
            asking = asyncio.create_task(daemon.client.get_stats())
            await asyncio.sleep(0.5)
            first_stop_s = next(at_s for at_s, line in daemon.board.heard if at_s > asked_s and line == STOP)
            assert 0.2 < first_stop_s - asked_s < 0.4
            await asyncio.gather(asking, return_exceptions=True)
            await asyncio.sleep(2 * CYCLE_S)
            told = (await daemon.client.get_state())["safety"]
            assert (told["armed"], told["fault"]) == (False, "loop_blocked")
            assert all(line == STOP for at_s, line in daemon.board.heard if at_s > first_stop_s)
        assert "loop_blocked" in daemon.log.read_text()

    asyncio.run(scenario())


def test_a_service_that_cannot_run_ends_the_program_with_a_stop(tmp_path: Path):
    """Odometry fails as soon as it starts, six times: exit code 1, the traceback in the log, zeros and nothing else."""

    async def scenario() -> None:
        board, link, log = Board(), tmp_path / "board", tmp_path / "log"
        pty = PtyBoard(board.hear, link)
        pty.plug()
        program = (
            f"from chefbotd import robot\n{BROKEN_SERVICE}\nfrom chefbotd.cli.daemon import main\nmain()"
        )
        arguments = ("run", "--port", str(link), "--listen", "127.0.0.1:0")
        with log.open("wb") as sink:
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-c", program, *arguments, stderr=sink
            )
        async with asyncio.timeout(PATIENCE_S):
            assert await process.wait() == 1
        pty.unplug()
        assert all(line == STOP for _, line in board.heard)
        assert "6 failures within 60 s" in log.read_text()
        assert "RuntimeError: broken" in log.read_text()

    asyncio.run(scenario())


def test_kill_9_leaves_the_motors_running(tmp_path: Path):
    """Nothing that runs in the process can help: the last duty stays in force. Only firmware can cover this."""

    async def scenario() -> None:
        async with running(tmp_path) as daemon:
            daemon.process.kill()
            assert await daemon.ended() == -signal.SIGKILL
            assert daemon.board.last != STOP

    asyncio.run(scenario())
