"""Pseudo-terminals that stand for the USB serial devices of a board and of lidars, with cables that can be pulled."""

import asyncio
import os
import re
import select
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from chefbotd.clock import Clock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.lidar import LidarRunner
from chefbotd.components.simulation.simulation import Simulation, build_lidars

READ_BYTES = 4096
HOST_POLL_S = 0.02


class PtyBoard:
    """The host's end is ``device``, and ``link_path`` if given: a stable name, like udev's, that points to it.

    The board has its own power, so it runs on while its cable is pulled. Bytes that the host does not take are lost
    and counted, as in a UART bridge: a device that nobody has open takes none, and one that is open but not read holds
    as many as the kernel's buffer (about 16 KiB).
    """

    def __init__(self, receive: Callable[[bytes], None], link_path: Path | None = None) -> None:
        self._receive, self._link_path = receive, link_path
        self._master: int | None = None
        self._hangups = select.poll()
        self._look_again: asyncio.TimerHandle | None = None
        self.device: Path | None = None
        self.bytes_dropped = 0

    def plug(self) -> Path:
        """Make a fresh device and return its path; one that is plugged in already stays as it is.

        Must be called in a running event loop.

        Raises:
            OSError: no pseudo-terminal is left, or ``link_path`` cannot be made or is something else already.
        """
        if self.device is not None:
            return self.device
        master, self.device = _open_raw()
        self._master = master
        self._hangups.register(master, 0)
        try:
            self._point_link(self.device)
        except OSError:
            self.unplug()
            raise
        self._await_host(master)
        return self.device

    def unplug(self) -> None:
        """Pull the cable: a host that has the device open sees a hang-up, and the device's names disappear."""
        if self._master is None or self.device is None:
            return
        if self._look_again is not None:
            self._look_again.cancel()
            self._look_again = None
        else:
            asyncio.get_running_loop().remove_reader(self._master)
        self._hangups.unregister(self._master)
        self._remove_link(self.device)
        os.close(self._master)
        self._master = self.device = None

    @property
    def host(self) -> object | None:
        """The device while any program has it open; None while none has."""
        return self.device if self._master is not None and self._host_is_there() else None

    def send(self, data: bytes) -> None:
        """Send to the host without waiting; bytes that find no room are lost."""
        self.bytes_dropped += len(data) - self._write(data)

    def _write(self, data: bytes) -> int:
        if self._master is None or not self._host_is_there():
            return 0
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def _host_is_there(self) -> bool:
        """Whether anybody has the device open: the kernel reports a hang-up while nobody has."""
        return not self._hangups.poll(0)

    def _await_host(self, master: int) -> None:
        """Look for a host at intervals. A reader on a device that no program has open would never wait."""
        loop = asyncio.get_running_loop()
        if self._host_is_there():
            self._look_again = None
            loop.add_reader(master, self._read, master)
        else:
            self._look_again = loop.call_later(HOST_POLL_S, self._await_host, master)
            self._hear_who_has_gone(master)

    def _hear_who_has_gone(self, master: int) -> None:
        """Take what a host has written that has come and gone since the last look."""
        try:
            data = os.read(master, READ_BYTES)
        except OSError:  # EIO: nothing
            return
        self._receive(data)

    def _read(self, master: int) -> None:
        try:
            data = os.read(master, READ_BYTES)
        except BlockingIOError:
            return
        except OSError:  # EIO: the last host has closed the device; what it has not read is not for the next
            asyncio.get_running_loop().remove_reader(master)
            termios.tcflush(master, termios.TCOFLUSH)
            self._await_host(master)
            return
        self._receive(data)

    def _point_link(self, device: Path) -> None:
        """Put the stable name in place at once; only a symbolic link is ever replaced."""
        if self._link_path is None:
            return
        if self._link_path.exists() and not self._link_path.is_symlink():
            raise FileExistsError(f"{self._link_path} is not a symbolic link, so it is not replaced")
        fresh = self._link_path.with_name(f".{self._link_path.name}.{os.getpid()}")
        try:
            fresh.symlink_to(device)
        except OSError as error:
            raise OSError(f"{self._link_path}: cannot be made: {error.strerror}") from error
        fresh.replace(self._link_path)

    def _remove_link(self, device: Path) -> None:
        """Remove the stable name, unless it points to another board now."""
        link = self._link_path
        if link is not None and link.is_symlink() and link.readlink() == device:
            link.unlink()


def _open_raw() -> tuple[int, Path]:
    """A new pseudo-terminal in raw mode: our end, not blocking, and the path of the host's."""
    master, slave = os.openpty()
    try:
        tty.setraw(slave)
        device = Path(os.ttyname(slave))
    finally:
        os.close(slave)
    os.set_blocking(master, False)
    return master, device


PLAIN = re.compile(r"[\w.-]+")


class PluggedLidars:
    """The lidars of a simulated robot; ``devices`` has the path of each by its name: the board's, ``-`` and the name.

    A name that is not plain gives way to the lidar's number, from 0.
    """

    def __init__(
        self,
        simulation: Simulation,
        board: BoardRunner,
        clock: Clock,
        board_path: Path | None,
        seed: int | None = None,
    ) -> None:
        self._ptys: dict[str, PtyBoard] = {}
        self.devices: dict[str, Path] = {}
        self.runners: dict[str, LidarRunner] = {}
        for number, (name, lidar) in enumerate(build_lidars(simulation, seed).items()):
            if board_path is not None:
                suffix = name if PLAIN.fullmatch(name) else str(number)
                self.devices[name] = board_path.with_name(f"{board_path.name}-{suffix}")
            pty = self._ptys[name] = PtyBoard(self._receiver(name), self.devices.get(name))
            self.runners[name] = LidarRunner(lidar, board, pty.send, clock, seed=number)

    def _receiver(self, name: str) -> Callable[[bytes], None]:
        return lambda data: self.runners[name].receive(data)

    def plug(self, name: str | None = None) -> dict[str, Path]:
        """Make the devices of all lidars, or of this one, and return their paths.

        Raises:
            KeyError: there is no lidar of this name.
            OSError: a device cannot be made.
        """
        names = self._ptys if name is None else (name,)
        return {lidar: self._ptys[lidar].plug() for lidar in names}

    def unplug(self) -> None:
        """Pull the cables of all lidars."""
        for pty in self._ptys.values():
            pty.unplug()

    async def run(self) -> None:
        """Simulate until cancelled."""
        async with asyncio.TaskGroup() as group:
            for runner in self.runners.values():
                group.create_task(runner.run())
