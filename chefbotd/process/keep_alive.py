"""Notifies systemd while the daemon makes progress (``WatchdogSec=``), and updates its status line.

The watchdog message is not sent while the control loop has stopped, or while bytes from the board wait unread. systemd
then ends the daemon and starts it again. A pulled cable or a silent board is no reason for a restart, which would not
bring them back.
"""

import asyncio
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import structlog


def notify(state: str) -> bool:
    """Send ``READY=1``, ``STOPPING=1``, ... ; returns False when nobody is listening at ``NOTIFY_SOCKET``."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return False
    if address.startswith("@"):
        address = "\0" + address[1:]
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.connect(address)
            sender.sendall(state.encode())
    except OSError as error:
        log.warning("systemd cannot be notified", state=state, error=str(error))
        return False
    return True


def is_listening() -> bool:
    """Whether the daemon was started as a service of ``Type=notify``."""
    return bool(os.environ.get("NOTIFY_SOCKET"))


def runtime_folder() -> Path | None:
    """The first ``RuntimeDirectory=`` of the unit (systemd.exec(5)); None where there is none."""
    first, _, _ = os.environ.get("RUNTIME_DIRECTORY", "").partition(":")
    return Path(first) if first else None


log = structlog.get_logger(component="systemd")

PERIOD_S = 1.0
"""The longest time between two messages to systemd."""

WORDS_PER_WATCHDOG = 4
"""Messages within ``WatchdogSec=``, so that one late message ends nothing (sd_watchdog_enabled(3): at least two)."""


class ControlLoop(Protocol):
    """The control loop."""

    @property
    def acted_s(self) -> float:
        """When it last ran."""
        ...


class Reader(Protocol):
    """What reads the board's bytes."""

    @property
    def bytes_in(self) -> int:
        """Bytes read so far."""
        ...

    def unread_bytes(self) -> int:
        """How many bytes wait to be read."""
        ...


class KeepAlive:
    """``tell`` brings a message to systemd, ``status`` is the line for people, ``watchdog_s`` is ``WatchdogSec=``."""

    def __init__(
        self,
        control: ControlLoop,
        reader: Reader,
        tell: Callable[[str], object],
        status: Callable[[], str],
        watchdog_s: float | None,
    ) -> None:
        self._control, self._reader, self._tell, self._status = control, reader, tell, status
        self._has_watchdog = watchdog_s is not None
        self._period_s = PERIOD_S if watchdog_s is None else min(PERIOD_S, watchdog_s / WORDS_PER_WATCHDOG)
        self._acted_s, self._bytes_in, self._had_unread = float("-inf"), 0, False
        self._said, self._complaint = "", ""

    async def run(self) -> None:
        """Notify systemd until cancelled."""
        while True:
            await asyncio.sleep(self._period_s)
            self.beat()

    def beat(self) -> None:
        """Look once, and return the messages for systemd."""
        stuck, status = self._stuck(), self._status()
        if stuck != self._complaint:
            self._complaint = stuck
            if stuck:
                log.error("systemd's watchdog is not fed", reason=stuck)
        words = [] if status == self._said else [f"STATUS={status}"]
        self._said = status
        if self._has_watchdog and not stuck:
            words.append("WATCHDOG=1")
        if words:
            self._tell("\n".join(words))

    def _stuck(self) -> str:
        """The part that made no progress since the last look, for people; empty if all did."""
        acted_s, bytes_in, unread = self._control.acted_s, self._reader.bytes_in, self._reader.unread_bytes()
        stands = acted_s == self._acted_s
        unheard = self._had_unread and unread > 0 and bytes_in == self._bytes_in
        self._acted_s, self._bytes_in, self._had_unread = acted_s, bytes_in, unread > 0
        if stands:
            return "the control loop has stopped"
        return f"{unread} bytes of the board wait, and nobody reads them" if unheard else ""


def watchdog_s_of(environment: Mapping[str, str]) -> float | None:
    """``WatchdogSec=`` of the unit as sd_watchdog_enabled(3) reads it; None where there is none, or it is another's."""
    text, pid = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if not (text.isascii() and text.isdigit()) or int(text) == 0:
        return None
    if pid and pid != str(os.getpid()):
        return None
    return int(text) / 1e6
