"""The udev rule that gives a board a name of its own, whatever else is plugged in and in whichever order."""

import re
from typing import Final

from chefbotd.components.doctor.listening.ports import SerialPort

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
SAFE: Final = re.compile(r"[^A-Za-z0-9#+\-.:=@_/ ]")
"""What udev's patterns and quotes could be broken by is matched as any character."""

RULES_FILE: Final = "/etc/udev/rules.d/61-{name}.rules"


def udev_rule(port: SerialPort, name: str) -> str:
    """Lines for a file in ``/etc/udev/rules.d``: ``/dev/NAME`` is this board, and ModemManager leaves it alone.

    All of its ``ATTRS`` are of one parent device, the USB device (udev(7)).

    Raises:
        ValueError: the name is none, or the port is not on USB.
    """
    if NAME.fullmatch(name) is None:
        raise ValueError(f"{name!r} is no name for a device: letters, digits, - and _ are allowed")
    vendor, _, product = port.usb_id.partition(":")
    if not product:
        raise ValueError(f"{port.device} is not on USB, so it has no numbers by which udev could know it")
    matches = [f'ATTRS{{idVendor}}=="{vendor}"', f'ATTRS{{idProduct}}=="{product}"']
    note = f"# {port.usb_id} as /dev/{name}"
    if port.serial_number:
        matches.append(f'ATTRS{{serial}}=="{SAFE.sub("?", port.serial_number)}"')
    else:
        note += "; it has no serial number, so every adapter of this kind matches: plug in only one"
    gives = [f'SYMLINK+="{name}"', 'GROUP="dialout"', 'MODE="0660"', 'ENV{ID_MM_DEVICE_IGNORE}="1"']
    rule = ", ".join(['SUBSYSTEM=="tty"', *matches, *gives])
    return f"{note}\n{rule}\n"
