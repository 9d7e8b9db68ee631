"""Faults of the daemon's process: it is signalled, killed, blocked or short of memory.

The real program runs in real time on a pty with a simulated robot, so measured times include the machine's own delays.
"""

import asyncio
import contextlib
import os
import signal
import tempfile
import time
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from chefbotd.client import ChefbotError, Client
from chefbotd.process.signals import name_of
from tests.scenarios.fault_run import ENDED, Expected, Result, motion
from tests.scenarios.faults.outcomes import DRIVES_ON, drives_on, estopped, latched
from tests.scenarios.instruments import MOVING_M_S
from tests.scenarios.process import (
    BLOCKED,
    CRASH,
    FEW_DESCRIPTORS,
    OUT_OF_MEMORY,
    PATIENCE_S,
    PERIOD_S,
    SPEED_M_S,
    UNREAD_LOG,
    Board,
    Program,
    driving,
    second_daemon,
)
from tests.scenarios.robots import ROBOTS

IDLE_CLIENTS, FROZEN_S, HELD_UP_S = 60, 1.1, 0.6
RUN_UP_S, WATCHED_S = 0.8, 2.0
LOOK_S = 0.005
SENT = (
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGPROF,
    signal.SIGSEGV,
    int(signal.SIGRTMIN) + 1,
)
"""One of each sort; tests/chefbotd/test_signals.py sends every one that there is."""

Act = Callable[[Program, Client], Coroutine[Any, Any, tuple[str, ...]]]
"""Makes it happen; returns what was not as it should be."""


@dataclass(frozen=True, slots=True)
class Ending:
    """``act`` makes it happen to a program with ``fault`` in it; ``exit_code`` is None where the program goes on.

    ``row`` is how its row of docs/safety.md begins. What is expected of the log is looked for in its text.
    """

    row: str
    name: str
    act: Act
    expected: Expected
    exit_code: int | None = None
    fault: str = ""
    robots: tuple[str, ...] = ROBOTS


async def _signalled(number: int, program: Program, client: Client) -> tuple[str, ...]:
    del client
    os.kill(program.process.pid, number)
    return ()


async def _asked(program: Program, client: Client) -> tuple[str, ...]:
    """For its statistics, which is where the fault is."""
    del program
    with contextlib.suppress(ChefbotError):
        await client.call("get_stats")
    return ()


async def _renamed(program: Program, client: Client) -> tuple[str, ...]:
    """The cable is pulled, and the device comes back under another name behind its stable one."""
    del client
    before = program.board.device.readlink()
    program.board.unplug()
    await asyncio.sleep(PERIOD_S)
    taken = os.openpty()
    try:
        program.board.plug()
        await asyncio.sleep(WATCHED_S / 2)
    finally:
        for descriptor in taken:
            os.close(descriptor)
    return ("the device has its old name",) if program.board.device.readlink() == before else ()


async def _contended(program: Program, client: Client) -> tuple[str, ...]:
    """A second daemon wants the same device."""
    del client
    async with second_daemon(program) as second, asyncio.timeout(PATIENCE_S):
        while "link cannot be opened" not in (said := second.log.read_text()):  # noqa: ASYNC110 - nobody tells us
            await asyncio.sleep(PERIOD_S)
    owner = f"(pid {program.process.pid})"
    return () if "in use by" in said and owner in said else ("the second does not say who has it",)


async def _talkative(program: Program, client: Client) -> tuple[str, ...]:
    """Much happens that is worth a line in the log."""
    del client
    for _ in range(50):
        reader, writer = await asyncio.open_connection("127.0.0.1", program.port)
        writer.write(b"GET / HTTP/1.1\r\n\r\n")
        with contextlib.suppress(ConnectionError):
            await reader.read()
        writer.close()
    return ()


async def _crowded(program: Program, client: Client) -> tuple[str, ...]:
    """Sixty clients connect and only look on; then somebody comes and presses stop in earnest."""
    del client
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(IDLE_CLIENTS + 1):
            reader, writer = await asyncio.open_connection("127.0.0.1", program.port)
            stack.callback(writer.transport.abort)
        writer.write(b'{"jsonrpc":"2.0","id":1,"method":"estop","params":{"reason":"smoke"}}\n')
        await reader.readline()  # the greeting
        answer = await reader.readline()
        await asyncio.sleep(WATCHED_S / 3)
    return () if b'"ok":true' in answer else (f"answered with {answer!r}",)


async def _frozen(seconds: float, program: Program, client: Client) -> tuple[str, ...]:
    """Stopped and continued, as by a debugger; the driver's commands wait in the kernel meanwhile."""
    del client
    os.kill(program.process.pid, signal.SIGSTOP)
    try:
        await asyncio.sleep(seconds)
    finally:
        os.kill(program.process.pid, signal.SIGCONT)
    return ()


STOPPED = Expected(ENDED, None, 0.25, ("stopped",))
KILLED = Expected(ENDED, None, 0.6)
"""The guard, a process of its own, opens the port that the dead one has left."""

PROCESS_FAULTS = (
    *(
        Ending(
            "Any signal that would end the program", name_of(number), partial(_signalled, number), STOPPED, 0
        )
        for number in SENT
    ),
    Ending("Ctrl-Z (SIGTSTP)", "SIGTSTP (Ctrl-Z)", partial(_signalled, signal.SIGTSTP), DRIVES_ON),
    Ending(
        "Event loop blocked",
        "event loop blocked for 1 s",
        _asked,
        latched("loop_blocked", 0.5),
        fault=BLOCKED,
    ),
    Ending(
        "The program is frozen",
        "SIGSTOP and SIGCONT after 1.1 s",
        partial(_frozen, FROZEN_S),
        latched("loop_blocked", FROZEN_S + 0.25),
    ),
    Ending(
        "The control loop is held up",
        "SIGSTOP and SIGCONT after 0.6 s",
        partial(_frozen, HELD_UP_S),
        drives_on("the control loop stood still while it drove"),
    ),
    Ending(
        "Too many clients",
        "64 descriptors, 60 idle clients, estop",
        _crowded,
        estopped(0.5),
        fault=FEW_DESCRIPTORS,
    ),
    Ending(
        "A request breaks its handler",
        "out of memory in a request",
        _asked,
        drives_on("handler_fault"),
        fault=OUT_OF_MEMORY,
    ),
    Ending("Nobody reads the log", "nobody reads the log", _talkative, DRIVES_ON, fault=UNREAD_LOG),
    Ending(
        "The device comes back under another name",
        "device comes back under another name",
        _renamed,
        latched("link_lost", 0.5, "link lost"),
    ),
    Ending("Device in use by another program", "second daemon on the device", _contended, DRIVES_ON),
    Ending("`kill -9`", "SIGKILL (kill -9)", partial(_signalled, signal.SIGKILL), KILLED, -signal.SIGKILL),
    Ending("`kill -9`", "crash (SIGSEGV)", _asked, KILLED, -signal.SIGSEGV, CRASH),
)


def attempt(ending: Ending, robot_name: str) -> Result:
    """Let it happen to a fresh program."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-faults-") as folder:
        return asyncio.run(_measured(ending, robot_name, Path(folder)))


async def _measured(ending: Ending, robot_name: str, folder: Path) -> Result:
    async with driving(folder, ending.fault, robot_name) as (program, client):
        commanding = asyncio.create_task(_command(client))
        await asyncio.sleep(RUN_UP_S)
        acting = asyncio.create_task(ending.act(program, client))
        zero_s, rest_s = await _watch(program.board)
        speed_m_s = program.board.speed_m_s
        clients_lost = int(not client.connected)
        wrong = (*(await acting), *_wrong(ending, program, zero_s), *await _misled(ending.expected, client))
        commanding.cancel()
        await asyncio.gather(commanding, return_exceptions=True)
        missing = [entry for entry in ending.expected.log if not await program.logged(entry)]
    wrong += tuple(f"log has no {entry!r}" for entry in missing)
    moved = motion(zero_s, rest_s, speed_m_s, stops=ending.expected.zero_within_s is not None)
    return Result(robot_name, ending.name, *moved, 0, clients_lost, wrong)


async def _command(client: Client) -> None:
    """Drive on, whatever is answered."""
    while client.connected:
        with contextlib.suppress(ChefbotError):
            await client.drive(SPEED_M_S, 0.0)
        await asyncio.sleep(PERIOD_S)


async def _watch(board: Board) -> tuple[float, float]:
    """When, from now, the board was last told to move, and when the robot last moved."""
    start_s, zero_s, rest_s = time.monotonic(), 0.0, 0.0
    while (elapsed_s := time.monotonic() - start_s) < WATCHED_S:
        if board.told_to_move:
            zero_s = elapsed_s
        if board.speed_m_s > MOVING_M_S:
            rest_s = elapsed_s
        await asyncio.sleep(LOOK_S)
    return zero_s, rest_s


def _wrong(ending: Ending, program: Program, zero_s: float) -> Iterator[str]:
    within_s, moves = ending.expected.zero_within_s, program.board.speed_m_s > MOVING_M_S
    if program.process.returncode != ending.exit_code:
        yield f"exit code {program.process.returncode}"
    if moves != (within_s is None):
        yield "drives on" if moves else "does not drive on"
    if within_s is not None and zero_s > within_s:
        yield f"duty for {zero_s:.3f} s"


async def _misled(expected: Expected, client: Client) -> tuple[str, ...]:
    """What a client is told that is not so."""
    try:
        safety = (await client.call("get_state"))["safety"]
        told = (safety["mode"], safety["fault"] or safety["limited_by"])
    except ChefbotError:
        told = (ENDED, None)
    return () if told == (expected.mode, expected.kind) else (f"told as {told}",)
