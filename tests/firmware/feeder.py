"""A process that drives the Stellaris board's image in QEMU, and is killed or frozen: how long the motors run on.

QEMU's clock does not keep to the computer's, so no daemon can follow it: this process writes as fast as the board reads.
It runs ``python -m tests.firmware.feeder FILE_NUMBER``, with the number of the serial line's socket.
"""

import os
import random
import signal
import socket
import subprocess
import sys
from itertools import cycle

from tests.firmware.host import seal
from tests.firmware.qemu import Qemu
from tests.firmware.tools import ROOT

MOST_UNREAD_BYTES = 4096
SETTLED_S = 0.3
"""Of the board's time without a byte: the dead-man is over."""


def _feed(line: socket.socket) -> None:
    """Agree on the checked mode and write duties for ever; pieces of any length, so that lines are cut."""
    line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_UNREAD_BYTES)
    chance = random.Random()
    for number in cycle(range(255)):
        body = "hello 1 250" if number == 0 else f"s {chance.randrange(50, 256)} {-chance.randrange(50, 256)}"
        data = seal(f"{body} {number}").encode() + b"\r"
        cut = chance.randrange(len(data))
        line.sendall(data[:cut])
        line.sendall(data[cut:])


def ran_on_us(board: Qemu, number: signal.Signals) -> int:
    """Send a process that drives the board this signal: by the board's clock, from the last byte to duty 0."""
    line = board.line.fileno()
    feeder = subprocess.Popen([sys.executable, "-m", __name__, str(line)], cwd=ROOT, pass_fds=[line])
    try:
        for _ in range(random.randrange(2, 20)):
            board.await_motion()
        os.kill(feeder.pid, number)
        before = None
        while (observed := board.await_standstill()) != before:
            before = observed
            board.forget()
            board.pass_time(SETTLED_S)
    finally:
        feeder.kill()
        feeder.wait()
    board.write(b"\r")  # ends what was cut
    return observed.ended_us - observed.heard_us


if __name__ == "__main__":
    _feed(socket.socket(fileno=int(sys.argv[1])))
