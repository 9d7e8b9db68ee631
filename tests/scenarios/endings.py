"""Faults of the program itself: the real one in a process, which is signalled, killed, blocked or short of memory.

In real time and on a real pty, with the simulated robot at its other end, so what is measured has the machine's own
delays in it.
"""

import asyncio
import contextlib
import os
import signal
import tempfile
import time
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from chefbotd.client import Client, ClientError
from chefbotd.signals import CRASHES, ENDING, name_of
from tests.scenarios.instruments import MOVING_M_S
from tests.scenarios.process import BLOCKED, OUT_OF_MEMORY, PERIOD_S, SPEED_M_S, Board, Program, driving
from tests.scenarios.trial import Result, motion

RUN_UP_S, WATCHED_S = 0.8, 1.5
LOOK_S = 0.005

Act = Callable[[Program, Client], Coroutine[Any, Any, None]]


@dataclass(frozen=True, slots=True)
class Ending:
    """``act`` makes it happen to a program with ``fault`` in it.

    Zero is on the motors within ``zero_within_s`` (None: the motors run on); the program ends with ``exit_code``
    (None: it goes on).
    """

    name: str
    act: Act
    zero_within_s: float | None
    exit_code: int | None
    fault: str = ""


async def _signalled(number: int, program: Program, client: Client) -> None:
    del client
    os.kill(program.process.pid, number)


async def _asked(program: Program, client: Client) -> None:
    """For its statistics, which is where the fault is."""
    del program
    with contextlib.suppress(ClientError):
        await client.get_stats()


REAL_TIME = range(signal.SIGRTMIN + 1, signal.SIGRTMAX)
SENT = sorted(ENDING.union(CRASHES).difference(REAL_TIME))
"""Every signal that can be answered; of the real-time ones the first and the last."""

ENDINGS = (
    *(Ending(name_of(number), partial(_signalled, number), 0.25, 0) for number in SENT),
    Ending("SIGTSTP (Ctrl-Z)", partial(_signalled, signal.SIGTSTP), None, None),
    Ending("event loop blocked for 1 s", _asked, 0.5, None, BLOCKED),
    Ending("out of memory in a request", _asked, None, None, OUT_OF_MEMORY),
    Ending("SIGKILL (kill -9)", partial(_signalled, signal.SIGKILL), None, -signal.SIGKILL),
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
        wrong = _wrong(ending, program, zero_s)
        clients_lost = int(not client.connected)
        commanding.cancel()
        await asyncio.gather(commanding, acting, return_exceptions=True)
    moved = motion(zero_s, rest_s, speed_m_s, stops=ending.zero_within_s is not None)
    return Result(robot_name, ending.name, *moved, 0, clients_lost, wrong)


async def _command(client: Client) -> None:
    """Drive on, whatever is answered."""
    while client.connected:
        with contextlib.suppress(ClientError):
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


def _wrong(ending: Ending, program: Program, zero_s: float) -> tuple[str, ...]:
    wrong = []
    moves = program.board.speed_m_s > MOVING_M_S
    if program.process.returncode != ending.exit_code:
        wrong.append(f"exit code {program.process.returncode}")
    if moves != (ending.zero_within_s is None):
        wrong.append("drives on" if moves else "does not drive on")
    if ending.zero_within_s is not None and zero_s > ending.zero_within_s:
        wrong.append(f"duty for {zero_s:.3f} s")
    return tuple(wrong)
