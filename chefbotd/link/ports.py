"""The serial ports of this computer: names, USB ids, driver, who has them, and why one cannot be opened."""

import errno
import grp
import os
from collections.abc import Sequence
from pathlib import Path

from serial.tools import list_ports

from chefbotd.core.record import Record
from chefbotd.link.owner import UNKNOWN, owner_of

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
    names = _names(by_id)
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


class SerialPort(Record, frozen=True):
    """A port as it is plugged in. ``permission`` says what to do where we may not open it, ``held_by`` who has it."""

    device: str
    by_id: str = ""
    usb_id: str = ""
    driver: str = ""
    product: str = ""
    permission: str = ""
    held_by: str = ""


def serial_ports(devices: Sequence[str] = (), by_id: Path = BY_ID) -> list[SerialPort]:
    """These devices (a pseudo-terminal is in no list), or else every serial port of the computer."""
    names = _names(by_id)
    found = {port.device: port for port in list_ports.comports()}
    return [_described(device, found.get(device), names) for device in devices or sorted(found)]


def _names(by_id: Path) -> dict[Path, str]:
    try:
        return {path.resolve(): str(path) for path in sorted(by_id.iterdir())}
    except OSError:
        return {}


def _described(device: str, usb: object, names: dict[Path, str]) -> SerialPort:
    vendor, product = getattr(usb, "vid", None), getattr(usb, "pid", None)
    return SerialPort(
        device=device,
        by_id=names.get(Path(device).resolve(), ""),
        usb_id="" if vendor is None or product is None else f"{vendor:04x}:{product:04x}",
        driver=_driver(device),
        product=getattr(usb, "description", None) or "",
        permission=permission_problem(device) if Path(device).exists() else "there is no such device",
        held_by=holder(device),
    )


def _driver(device: str, tty: Path = Path("/sys/class/tty")) -> str:
    try:
        return (tty / Path(device).resolve().name / "device" / "driver").resolve(strict=True).name
    except OSError:
        return ""


def permission_problem(device: str) -> str:
    """What to do where we may not read and write a device that is there; empty where we may."""
    if not Path(device).exists() or os.access(device, os.R_OK | os.W_OK):
        return ""
    return permission_advice(device)


def holder(device: str) -> str:
    """The programs that have a device open or locked, as far as we may see; empty: none."""
    try:
        owner = owner_of(device)
    except OSError:
        return ""
    return "" if owner == UNKNOWN else owner
