"""Why a port cannot be opened, for people: which ports are there instead, and what gives permission."""

import errno
import grp
import os
from pathlib import Path

from serial.tools import list_ports

BY_ID = Path("/dev/serial/by-id")
"""Names that stay the same whichever socket a cable is plugged into; udev makes them."""


def advice(device: str, error: OSError, by_id: Path = BY_ID) -> str:
    """What keeps ``device`` from being opened, and what to do about it."""
    if error.errno == errno.ENOENT:
        return f"there is no such device; {ports_there(by_id)}"
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"permission denied; {permission_advice(device)}"
    return str(error)


def ports_there(by_id: Path = BY_ID) -> str:
    """The serial ports of this computer, by their lasting names where they have any."""
    try:
        names = {path.resolve(): path for path in sorted(by_id.iterdir())}
    except OSError:
        names = {}
    found = sorted(port.device for port in list_ports.comports())
    if not found:
        return "no serial port was found: is the board plugged in and powered?"
    told = [f"{names[Path(port)]} ({port})" if Path(port) in names else port for port in found]
    return f"available serial ports: {', '.join(told)}"


def permission_advice(device: str) -> str:
    """Which group may open a device, and how to get into it."""
    try:
        status = Path(device).stat()
        group = grp.getgrgid(status.st_gid).gr_name
    except (OSError, KeyError):
        return "is this user allowed to use it?"
    if status.st_gid in os.getgroups() or group == "root":
        return f"{device} does not allow your group {group} to read and write: check its udev rule"
    return (
        f"only members of the group {group} may use it: run 'sudo usermod -aG {group} $USER', then log out and in again "
        f"(a service: SupplementaryGroups={group})"
    )
