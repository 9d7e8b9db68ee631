"""The notifications of a ``Type=notify`` service to systemd (sd_notify(3))."""

import os
import socket
from pathlib import Path

import structlog

log = structlog.get_logger(component="systemd")


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
