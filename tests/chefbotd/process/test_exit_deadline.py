"""The end of a process that a plug-in keeps."""

import subprocess
import sys

import pytest

from tests.waiting import PATIENCE_S

PROGRAM = """
import asyncio, threading, time
from chefbotd.process.exit_deadline import ExitDeadline

async def swallows():
    while True:
        try:
            await asyncio.sleep(1000)
        except asyncio.CancelledError:
            print("swallowed", flush=True)

async def main():
    task = asyncio.ensure_future({task}())
    {thread}
    await asyncio.sleep(0)
    deadline = ExitDeadline(within_s=0.2)
    deadline.start(asyncio.get_running_loop())
    deadline.start(asyncio.get_running_loop())
    print("stopped", flush=True)

async def ends():
    pass

asyncio.run(main())
"""
KEPT = "threading.Thread(target=time.sleep, args=(1000,), name='kept').start()"


@pytest.mark.parametrize(
    ("task", "thread", "code", "said"),
    [("swallows", "", 1, "swallows"), ("ends", KEPT, 1, "kept"), ("ends", "", 0, "")],
    ids=["swallows its cancellation", "keeps a thread", "ends"],
)
def test_a_process_ends_whatever_it_is_kept_by(task: str, thread: str, code: int, said: str) -> None:
    """With exit code 1 and a line that says by what; one that ends by itself ends as it would have."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.replace("{task}", task).replace("{thread}", thread)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert done.stdout.startswith("stopped") or "stopped" in done.stdout
    assert said in done.stdout + done.stderr
