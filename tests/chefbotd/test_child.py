"""What a child process ended by is known, whoever sends it signals as it ends."""

import asyncio
import os
import signal
import sys
from asyncio.subprocess import Process
from contextlib import suppress

import pytest

from chefbotd.child import send_signal

ENDINGS = 20


def end_while_told_to(child: Process) -> None:
    """It gets the signal when it has just ended, unless asyncio's thread was faster and has its exit code already."""
    os.kill(child.pid, signal.SIGKILL)
    with suppress(ChildProcessError):
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    send_signal(child, signal.SIGTERM)


@pytest.mark.realtime
def test_a_signal_to_a_child_that_is_ending_does_not_lose_its_exit_code() -> None:
    """Killed, and told to end when it just has: it was killed; and later a signal does nothing."""

    async def ended() -> int:
        child = await asyncio.create_subprocess_exec(
            sys.executable, "-c", "input()", stdin=asyncio.subprocess.PIPE
        )
        end_while_told_to(child)
        code = await child.wait()
        send_signal(child, signal.SIGTERM)
        return code

    async def all_ended() -> set[int]:
        return {await ended() for _ in range(ENDINGS)}

    assert asyncio.run(all_ended()) == {-signal.SIGKILL}


def test_a_child_that_runs_gets_the_signal() -> None:
    """SIGTERM ends it."""

    async def ended() -> int:
        child = await asyncio.create_subprocess_exec(
            sys.executable, "-c", "input()", stdin=asyncio.subprocess.PIPE
        )
        send_signal(child, signal.SIGTERM)
        return await child.wait()

    assert asyncio.run(ended()) == -signal.SIGTERM
