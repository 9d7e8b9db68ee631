"""What a child process ended by is known, whoever sends it signals as it ends."""

import asyncio
import os
import signal
import sys
import time
from asyncio.subprocess import Process

import pytest

from chefbotd.child import send_signal

ENDINGS = 20


def end_while_told_to(child: Process, after_s: float) -> None:
    """Nothing else happens in this process meanwhile."""
    os.kill(child.pid, signal.SIGKILL)
    time.sleep(after_s)
    send_signal(child, signal.SIGTERM)


@pytest.mark.realtime
def test_a_signal_to_a_child_that_is_ending_does_not_lose_its_exit_code() -> None:
    """Killed, and told to end at moments up to 2 ms later: it was killed; and once it has ended, nothing happens."""

    async def ended(after_s: float) -> int:
        child = await asyncio.create_subprocess_exec(
            sys.executable, "-c", "input()", stdin=asyncio.subprocess.PIPE
        )
        end_while_told_to(child, after_s)
        code = await child.wait()
        send_signal(child, signal.SIGTERM)
        return code

    async def all_ended() -> set[int]:
        return {await ended(0.002 * number / ENDINGS) for number in range(ENDINGS)}

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
