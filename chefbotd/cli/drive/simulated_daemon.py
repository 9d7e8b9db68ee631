"""Runs a daemon on a simulated robot in a child process."""

import asyncio
import os
import signal
import sys
import tempfile
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from types import MappingProxyType
from typing import IO, Final

from chefbotd.child import send_signal
from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client
from chefbotd.transport.ports import reserve_port

LISTENING_PATIENCE_S = 60.0
ENDING_PATIENCE_S = 20.0
RETRY_S = 0.05
LOG_TAIL_LINES = 20
CLOCK_KEY: Final = "CHEFBOTD_SIM__SHARED_CLOCK"


@asynccontextmanager
async def simulated_daemon(
    robot: Path | str = "chefbot",
    environment: Mapping[str, str] = MappingProxyType({}),
    *,
    own_clock: bool = False,
) -> AsyncIterator[tuple[Address, int]]:
    """Start ``chefbotd run --sim``, wait until it listens, and end it when the block ends, also after an error.

    Yields its address and its process id. ``robot`` is the configuration, or the name of a packaged one.
    ``environment`` is added to ours. With ``own_clock`` daemon, worker and simulated robot keep to a clock of their own,
    which a busy computer slows down, so that nothing is late; else to the computer's.

    Raises:
        ProgramError: it ended, or did not listen in time; its last log lines are in the message.
    """
    address = Address("127.0.0.1", reserve_port())
    with tempfile.TemporaryFile("w+") as log:
        async with _clock_in(environment, own_clock=own_clock) as theirs:
            words = ("run", "--sim", "--listen", str(address), "--config", str(robot))
            process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-m",
                "chefbotd.cli.programs.chefbotd",
                *words,
                stdout=log,
                stderr=log,
                env={**os.environ, **theirs},
                start_new_session=True,  # Ctrl-C reaches only us: we stop the robot before its daemon ends
            )
            try:
                await _listening(process, address, log)
                yield address, process.pid
            finally:
                code = await _end(process)
    if code != Exit.OK:
        raise ProgramError(Exit.FAILED, f"chefbotd ended with exit code {code}")


@asynccontextmanager
async def _clock_in(environment: Mapping[str, str], *, own_clock: bool) -> AsyncIterator[Mapping[str, str]]:
    """The environment of a daemon, with a clock that ends with the block if it is to have one.

    Raises:
        ProgramError: the clock did not begin in time.
    """
    if not own_clock:
        yield environment
        return
    with tempfile.TemporaryDirectory(prefix="chefbotctl-clock-") as folder:
        path = Path(folder) / "clock"
        words = ("-P", "-m", "chefbotd.shared_clock", str(path))
        clock = await asyncio.create_subprocess_exec(sys.executable, *words, start_new_session=True)
        try:
            await _until_there(path)
            yield {**environment, CLOCK_KEY: str(path)}
        finally:
            send_signal(clock, signal.SIGKILL)  # it has nothing to keep
            await clock.wait()


async def _until_there(path: Path) -> None:
    for _ in range(int(LISTENING_PATIENCE_S / RETRY_S)):
        if path.exists():  # noqa: ASYNC240 - in a folder of temporary files: it does not block
            return
        await asyncio.sleep(RETRY_S)
    reason = f"the simulated robot's clock did not begin within {LISTENING_PATIENCE_S:g} s"
    raise ProgramError(Exit.FAILED, reason)


async def _listening(process: Process, address: Address, log: IO[str]) -> None:
    try:
        async with asyncio.timeout(LISTENING_PATIENCE_S):
            while not await _accepts(address):
                if process.returncode is not None:
                    raise _failure(f"chefbotd ended with exit code {process.returncode}", log)
                await asyncio.sleep(RETRY_S)
    except TimeoutError:
        raise _failure(f"chefbotd did not start to listen within {LISTENING_PATIENCE_S:g} s", log) from None


async def _accepts(address: Address) -> bool:
    try:
        _, writer = await asyncio.open_connection(address.host, address.port)
    except ConnectionRefusedError:
        return False
    writer.close()
    return True


async def _end(process: Process) -> int:
    """Ask it to end, wait, and give its exit code."""
    send_signal(process, signal.SIGTERM)
    try:
        async with asyncio.timeout(ENDING_PATIENCE_S):
            return await process.wait()
    except TimeoutError:
        send_signal(process, signal.SIGKILL)
        await process.wait()
        raise ProgramError(
            Exit.FAILED, f"chefbotd did not end within {ENDING_PATIENCE_S:g} s of SIGTERM"
        ) from None


def _failure(what: str, log: IO[str]) -> ProgramError:
    log.seek(0)
    tail = log.readlines()[-LOG_TAIL_LINES:]
    return ProgramError(Exit.CANNOT_CONNECT, "; its log ends:\n".join([what, "".join(tail).rstrip()]))


READY_S: Final = 240.0
"""The worker compiles its code once, when it is started for the first time."""


async def until_ready(robot: Client, tell: Callable[[str], None]) -> int | None:
    """Wait until the worker can work and then until the robot can move, and tell what it waits for; the worker's pid.

    The worker is first: a clock of their own stands while it compiles, and without it no odometry comes.

    Raises:
        ProgramError: it cannot work here, or was not ready in time.
        CallTimeout: the robot cannot move; the message says what is missing.
    """
    worker_pid = await until_worker_ready(robot, tell)
    await robot.wait_until_armed(LISTENING_PATIENCE_S)
    return worker_pid


async def until_worker_ready(robot: Client, tell: Callable[[str], None]) -> int | None:
    """Wait, and tell what it is at; its process id.

    Raises:
        ProgramError: it cannot work here, or was not ready in time.
    """
    try:
        async with asyncio.timeout(READY_S), robot.subscribe("worker") as reports:
            async for event in reports:
                if event.data.state == "ready":
                    return event.data.pid
                if event.data.state == "unavailable":
                    raise ProgramError(Exit.NOT_DONE, event.data.reason)
                tell(f"the worker is {event.data.state} (the first time it compiles its code)")
    except TimeoutError:
        pass
    raise ProgramError(Exit.NOT_DONE, f"the worker was not ready within {READY_S:g} s")
