"""The second process: it outlives the daemon, and stops the motors if the daemon ends without a goodbye.

No program can do anything about ``kill -9``, and a classic board keeps its last duty for ever. So this one waits for
the end of a pipe. A goodbye before it: all is well. Without one the other has died: this one opens the port, waits until
the dead one has left it, and puts stops on the wire. It imports next to nothing, and sleeps until then.
"""

import contextlib
import fcntl
import os
import signal
import sys
import syslog
import termios
import time

END_MESSAGE = b"goodbye\n"
BEWARE = "the motors could not be stopped. Cut their power if the wheels turn"
STOPS, APART_S = 20, 0.1
"""The sketch may wait a second for an echo before it reads."""

PATIENCE_S = 10.0
"""How long a device that is gone, or in use, is waited for in all.

One that the kernel finds again is back within two seconds.
Whoever plugs a cable in again later stands beside the robot; until then this would be a program that nobody expects.
"""


WRITTEN, IN_USE, AWAY, NOT_OURS = "written", "in use", "away", "not ours"
"""What came of the stops: another program has the port, the device did not come back, it is another device now."""

Identity = tuple[int, int]
"""The inode of a pseudo-terminal, and when it was made."""


def pseudo_terminal(device: str) -> Identity | None:
    """What tells a pseudo-terminal from the next one with its number; None for other devices, and for a missing one.

    A symbolic link leads to the same board also when its pseudo-terminal is another one.
    """
    if not device.startswith("/dev/pts/"):
        return None
    try:
        status = os.stat(device)  # noqa: PTH116 (this program imports next to nothing)
    except OSError:
        return None
    return status.st_ino, status.st_ctime_ns


def stop_motors(
    device: str,
    baud: int,
    dtr: bool,
    rts: bool,
    stop: bytes,
    simulated: Identity | None = None,
    daemon: int = 0,
) -> str:
    """Open the port with DTR and RTS as the daemon sets them, and write stops: what came of it.

    ``daemon`` is the process that had the port. ``simulated`` is the pseudo-terminal of a simulated board: when that
    one is gone, nothing is written, because what has its number now is somebody's terminal.
    """
    import serial  # only now, so that the wait costs no memory

    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        if simulated is not None and pseudo_terminal(device) != simulated:
            return NOT_OURS
        port = serial.Serial(None, baud, write_timeout=1.0)
        port.port, port.dtr, port.rts = device, dtr, rts
        with contextlib.suppress(OSError, termios.error), port:  # a device that goes away raises either
            for written in range(STOPS):
                if not _is_left_to_us(port.fileno(), daemon, until_s):
                    return WRITTEN if written else IN_USE
                port.write(stop)
                time.sleep(APART_S)
            return WRITTEN
        time.sleep(APART_S)
    return AWAY


def _is_left_to_us(descriptor: int, daemon: int, until_s: float) -> bool:
    """Whether no other program has the port; a chefbotd that has it has put a stop on the wire first.

    The pipe ends before the daemon does: it, and a child that it was just starting, hold the lock until the kernel has
    taken all of it apart, which a busy computer puts off. Until then it is this program's parent, and no other program
    can have the lock that it holds. Any other port in use is waited for, until that time in all.
    """
    while not _is_free(descriptor) and (os.getppid() != daemon or _is_held_by_another(descriptor, daemon)):
        if time.monotonic() >= until_s:
            return False
        time.sleep(APART_S)
    return True


def _is_free(descriptor: int) -> bool:
    """Whether no other program holds the port's lock."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    fcntl.flock(descriptor, fcntl.LOCK_UN)
    return True


def _is_held_by_another(descriptor: int, daemon: int) -> bool:
    """Whether another process than the daemon, which may have waited for the port itself, holds the lock (proc(5))."""
    device = os.fstat(descriptor)
    inode = f"{os.major(device.st_dev):02x}:{os.minor(device.st_dev):02x}:{device.st_ino}"
    with contextlib.suppress(OSError), open("/proc/locks") as locks:  # noqa: PTH123 (this program imports next to nothing)
        for line in locks:
            _, kind, _, _, holder, place, *_ = line.split()
            if (kind, place) == ("FLOCK", inode):
                return int(holder) != daemon
    return False


def main() -> None:
    """Wait for the pipe's end; signals are for the other one. systemd's watchdog sends SIGABRT to this one, too."""
    for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP, signal.SIGCHLD}:
        signal.signal(number, signal.SIG_IGN)
    device, baud, dtr, rts, stop, daemon = sys.argv[1:]
    simulated = pseudo_terminal(device)
    if sys.stdin.buffer.read() == END_MESSAGE:
        return
    lines = dtr == "1", rts == "1"
    outcome = stop_motors(device, int(baud), *lines, bytes.fromhex(stop), simulated, int(daemon))
    if outcome == WRITTEN:
        tell(syslog.LOG_WARNING, f"chefbotd was killed: the motors on {device} were told to stop")
    elif outcome == IN_USE:
        tell(
            syslog.LOG_ERR,
            f"chefbotd was killed, and another program has had {device} since, so nothing was written: if it is not "
            f"chefbotd, {BEWARE}",
        )
    elif outcome == AWAY:
        tell(
            syslog.LOG_ERR,
            f"chefbotd was killed, and {device} was not back within {PATIENCE_S:g} s: {BEWARE}",
        )


def tell(level: int, text: str) -> None:
    """To the system's log: a pipe of the one that was killed would be kept open."""
    syslog.openlog("chefbotd", syslog.LOG_PID, syslog.LOG_DAEMON)
    syslog.syslog(level, text)


if __name__ == "__main__":
    main()
