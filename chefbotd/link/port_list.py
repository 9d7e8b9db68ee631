"""The serial ports of this computer: names, USB ids, driver, whether we may open them, and who has them."""

import os
from collections.abc import Sequence
from pathlib import Path

from serial.tools import list_ports

from chefbotd.core.record import Record
from chefbotd.link import ports
from chefbotd.link.owner import UNKNOWN, owner_of


class SerialPort(Record, frozen=True):
    """A port as it is plugged in. ``permission`` says what to do where we may not open it, ``held_by`` who has it."""

    device: str
    by_id: str = ""
    usb_id: str = ""
    driver: str = ""
    product: str = ""
    permission: str = ""
    held_by: str = ""


def serial_ports(devices: Sequence[str] = (), by_id: Path = ports.BY_ID) -> list[SerialPort]:
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
    return ports.permission_advice(device)


def holder(device: str) -> str:
    """The programs that have a device open or locked, as far as we may see; empty: none."""
    try:
        owner = owner_of(device)
    except OSError:
        return ""
    return "" if owner == UNKNOWN else owner
