"""A process that outlives another: when that one is killed without having said goodbye, it stops the motors.

No program can do anything about ``kill -9``, and a classic board keeps its last duty for ever. So the guard waits for
the end of a pipe. A goodbye before it: all is well. Without one the program has died: the guard opens its port and
puts stops on the wire.
"""

import asyncio
import contextlib
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import AsyncIterator

import serial

GOODBYE = b"goodbye\n"
STOPS, APART_S = 20, 0.1
"""The sketch may wait a second for an echo before it reads."""

OPENING_TRIES = 20
ENDING_S = 2.0


@contextlib.asynccontextmanager
async def stop_guard(device: str, baud: int, stop: bytes) -> AsyncIterator[None]:
    """Have a guard in a session of its own while the block lasts, however the block ends.

    A device that is no path (``socket://``) has none.
    """
    if "://" in device:
        yield
        return
    guard = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", __name__, device, str(baud), stop.hex()),
        stdin=PIPE,
        stdout=DEVNULL,
        stderr=DEVNULL,
        start_new_session=True,  # Ctrl-C is for the program, which stops the motors by itself
    )
    try:
        yield
    finally:
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(ENDING_S):
                await guard.communicate(GOODBYE)


def stop_motors(device: str, baud: int, stop: bytes) -> bool:
    """Open the port, which its killed owner has just left, and write stops: whether that went."""
    for _ in range(OPENING_TRIES):
        with contextlib.suppress(OSError), serial.Serial(device, baud, write_timeout=1.0) as port:
            for _ in range(STOPS):
                port.write(stop)
                time.sleep(APART_S)
            return True
        time.sleep(APART_S)
    return False


def main() -> None:
    """Wait for the pipe's end."""
    device, baud, stop = sys.argv[1:]
    if sys.stdin.buffer.read() != GOODBYE:
        stop_motors(device, int(baud), bytes.fromhex(stop))


if __name__ == "__main__":
    main()
