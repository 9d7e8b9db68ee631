"""The real program in a process of its own, on a real pty with the simulated robot behind it, as users start it."""

import asyncio
import os
import socket
import sys
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from chefbotd.client import CallError, Client, MotionInterrupted
from chefbotd.clock import SystemClock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.components.simulation.pty import PtyBoard
from chefbotd.components.simulation.simulation import board_sender, build_launchpad
from chefbotd.settings import packaged
from chefbotd.transport.ports import reserve_port
from tests.scenarios.robots import packaged_name, settings_of

PATIENCE_S = 100.0
"""For a whole scenario, which may start two daemons; a busy machine takes half a minute for each."""
SPEED_M_S = 0.2
REST_M_S = 0.005
PERIOD_S = 0.02
PLAIN: Mapping[str, str] = {}
BUSY_COMPUTER: Mapping[str, str] = {
    "CHEFBOTD_SAFETY__ENCODERS__MAX_AGE_S": "2",
    "CHEFBOTD_SAFETY__ENCODERS__LATCH_AFTER_S": "60",
    "CHEFBOTD_SAFETY__UNRESPONSIVE__REACTION_S": "10",
    "CHEFBOTD_SAFETY__WHEELS__STALLED_S": "60",
    "CHEFBOTD_WATCHDOG__LATCH_PAUSES": "100",
}
"""The simulated board runs in the test's own process: where that gets no time, the robot seems to have a fault."""

# A fault of the program itself is a few lines of Python before its start.
GET_STATS = """
import ctypes, functools, time
get_stats = service.StatsService.get_stats
service.StatsService.get_stats = functools.wraps(get_stats)(lambda self, caller, params: %s)
"""
BLOCKED = GET_STATS % "time.sleep(1.0)"
HELD = (
    "import os\n"
    + GET_STATS % "[time.sleep(0.01) for _ in iter(lambda: os.path.exists(os.environ['HELD']), False)]"
)
"""Blocked for as long as there is the file that the environment names."""
OUT_OF_MEMORY = GET_STATS % "bytearray(1 << 60)"
CRASH = GET_STATS % "ctypes.string_at(0)"
UNREAD_LOG = """
import os
unread, full = os.pipe()
os.set_blocking(full, False)
try:
    while os.write(full, bytes(4096)): pass
except BlockingIOError:
    os.set_blocking(full, True)
os.dup2(full, 2)
"""
FEW_DESCRIPTORS = """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
"""
NO_GUARD = """
import types
from chefbotd.process import stop_guard
stop_guard.sys = types.SimpleNamespace(executable="/nowhere/python")
"""
BROKEN_SERVICE = """
from chefbotd.driving.odometry import service as odometry
async def broken(self): raise RuntimeError("broken")
odometry.OdometryService.run = broken
"""


class Board:
    """The simulated board on a pty; keeps every line that it hears, with the time."""

    def __init__(self, robot: str, device: Path) -> None:
        self.robot, self.device = robot, device
        self.heard: list[tuple[float, bytes]] = []
        self._rest = b""
        self._pty = PtyBoard(self._hear, device)
        simulation = simulation_of(settings_of(robot, {}))
        self._stop = b"s" + b" 0" * simulation.variant.wheels
        send = board_sender(simulation, self._pty.send, lambda: self._pty.host)
        self._runner = BoardRunner(build_launchpad(simulation), send, SystemClock())

    @property
    def told_to_move(self) -> bool:
        """Whether the command now in force is none and no stop."""
        return bool(self.heard) and not self.is_stop(self.heard[-1][1])

    @property
    def speed_m_s(self) -> float:
        """How fast the robot really goes."""
        return abs(self._runner.truth(0.0).twist.linear_m_s)

    def is_stop(self, line: bytes) -> bool:
        """Whether this is zero for every wheel."""
        return line == self._stop

    def plug(self) -> None:
        """Put the cable back: a new device behind the stable name."""
        self._pty.plug()

    def unplug(self) -> None:
        """Pull the cable; the board keeps its power and its last command."""
        self._pty.unplug()

    @asynccontextmanager
    async def plugged(self) -> AsyncIterator[None]:
        """Powered and plugged in while the context lasts."""
        self.plug()
        living = asyncio.create_task(self._runner.run())
        try:
            yield
        finally:
            living.cancel()
            await asyncio.gather(living, return_exceptions=True)
            self.unplug()

    def _hear(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\r")
        self.heard += [(time.monotonic(), line) for line in lines]
        self._runner.receive(data)


@dataclass
class Program:
    """The daemon's process, its board, where it listens, its log, and what it finds in its environment."""

    process: asyncio.subprocess.Process
    board: Board
    port: int
    log: Path
    environment: Mapping[str, str]

    async def ended(self) -> int:
        """Its exit code, once the board has heard the last of it."""
        async with asyncio.timeout(PATIENCE_S):
            code = await self.process.wait()
        await asyncio.sleep(2 * PERIOD_S)
        return code

    async def logged(self, entry: str) -> bool:
        """Whether the log has this entry, which a thread of the daemon writes; waits for it."""
        with suppress(TimeoutError):
            async with asyncio.timeout(PATIENCE_S):
                while entry not in self.log.read_text() and self.process.returncode is None:  # noqa: ASYNC110
                    await asyncio.sleep(PERIOD_S)
        return entry in self.log.read_text()

    @asynccontextmanager
    async def client(self) -> AsyncIterator[Client]:
        """A client, once the daemon listens."""
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port)).close()
                break
            except ConnectionRefusedError:
                assert self.process.returncode is None, "the daemon has ended"
                await asyncio.sleep(PERIOD_S)
        async with Client.connect("127.0.0.1", self.port) as client:
            yield client


@asynccontextmanager
async def started(
    folder: Path,
    fault: str = "",
    robot: str = "chefbot",
    host: str = "127.0.0.1",
    environment: Mapping[str, str] = PLAIN,
) -> AsyncIterator[Program]:
    """Start the daemon with a fault in it; at the end it is killed if it has not ended."""
    board = Board(robot, folder / "board")
    async with board.plugged(), _daemon(board, folder / "log", fault, host, environment) as program:
        yield program


@asynccontextmanager
async def second_daemon(first: Program) -> AsyncIterator[Program]:
    """One more on the same device in the same environment, while the first has it or after that."""
    log = first.log.with_name("second log")
    async with _daemon(first.board, log, "", "127.0.0.1", first.environment) as second:
        yield second


@asynccontextmanager
async def _daemon(
    board: Board, log: Path, fault: str, host: str, environment: Mapping[str, str]
) -> AsyncIterator[Program]:
    port = reserve_port()
    start = "from chefbotd.cli.programs.chefbotd import main\nmain()"
    program = f"from chefbotd.components.statistics import service\n{fault}\n{start}"
    where = ("--port", str(board.device), "--listen", f"{host}:{port}")
    inherited = {name: text for name, text in os.environ.items() if name != "RUNTIME_DIRECTORY"}
    with log.open("wb") as sink:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            *("-c", program, "run", "--config", str(packaged(packaged_name(board.robot))), *where),
            stderr=sink,
            env={**inherited, **BUSY_COMPUTER, **environment},
        )
    try:
        yield Program(process, board, port, log, environment)
    except BaseException as error:
        error.add_note(f"exit code {process.returncode}, and its log:\n{_text_of(log)}")
        raise
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


def _text_of(log: Path) -> str:
    return log.read_text(errors="replace")


@asynccontextmanager
async def driving(
    folder: Path, fault: str = "", robot: str = "chefbot", environment: Mapping[str, str] = PLAIN
) -> AsyncIterator[tuple[Program, Client]]:
    """Start the daemon, and drive until it moves."""
    async with (
        asyncio.timeout(PATIENCE_S),
        started(folder, fault, robot, environment=environment) as program,
        program.client() as client,
    ):
        await drive_until_told(program.board, client)
        yield program, client


async def drive_until_told(board: Board, client: Client) -> None:
    """Command a motion until the board hears of one."""
    while not board.told_to_move:
        await drive_once(client)
        await asyncio.sleep(PERIOD_S)


async def drive_on(board: Board, client: Client) -> None:
    """Command a motion until the board hears of one more."""
    before = len(board.heard)
    while all(map(board.is_stop, (line for _, line in board.heard[before:]))):
        await drive_once(client)
        await asyncio.sleep(PERIOD_S)


async def stopped(board: Board) -> None:
    """Until the board was told to stand, and the robot does; the scenario's end is the only limit."""
    while board.told_to_move or board.speed_m_s > REST_M_S:  # noqa: ASYNC110 - nobody tells us
        await asyncio.sleep(PERIOD_S)


async def drive_once(client: Client) -> None:
    """Nobody drives a robot whose board is not heard yet; what waited too long on a busy machine is sent again."""
    try:
        await client.drive(SPEED_M_S, 0.0)
    except CallError as refusal:
        if refusal.kind not in ("link_down", "too_old"):
            raise
    except MotionInterrupted:
        return
