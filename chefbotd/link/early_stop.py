"""The first stop: `chefbotd run` stops the motors before it imports what it runs by, which takes most of its start.

A board without a dead-man drives on while a daemon that was killed starts again. So the program reads the device from
the configuration, opens and locks it, sets it up as the daemon will, writes stops, and keeps it open until the daemon
has opened it too: the board sees one opening. The motors stop earlier; the robot is not ready earlier.

Where anything is not plain (a simulated robot, an option or a value that is not known here, a port in use) nothing is
done: the daemon checks it all, and says what is wrong. Nothing is imported that the start does not need anyway.
"""

import fcntl
import os
import stat
import struct
import termios
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from chefbotd.packaged import packaged_folder

PREFIX = "chefbotd_"
STOPS = {
    "classic": b"s 0 0\r",
    "four_wheels": b"s 0 0 0 0\r",
    "khan": b"s 0 0 0 0\r",
    "khan_edges": b"s 0 0 0 0\r",
}
"""The line that stops the motors, by the name of the wire (as ``link.wires.stop_line`` has it)."""

FIRST_STOPS = 2
"""As ``link.board_writer`` has it: a line that was cut short takes the first stop with it."""

DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    "link": {
        "device": "/dev/ttyACM0",
        "baud": 115200,
        "exclusive": True,
        "dtr": True,
        "rts": True,
        "hang_up_on_close": False,
    },
    "robot": {"wire": "classic"},
}
"""The keys that are needed, with their defaults (as ``LinkParameters`` and ``RobotParameters`` have them)."""

OF_RUN = {"--config": True, "--port": True, "--listen": True, "--log-level": True, "--page": False}
"""The options of `chefbotd run` that change nothing here but the first two, and whether each has a value."""

MOST_BYTES = 1_000_000
"""No robot's file is so long."""

DEEPEST = 4
"""How many files may extend one another."""

_opened: list[tuple[str, int]] = []
"""The device that is open since the first stop, with its descriptor; one at most."""


def stop_early(arguments: Sequence[str], environment: Mapping[str, str]) -> None:
    """Stop the motors of the robot that this command line runs, and keep its port open.

    Never raises: what fails here fails again in the daemon, which says it.
    """
    with suppress(OSError, termios.error, ValueError, RecursionError):
        values = read_link(arguments, environment)
        if values is not None and values["exclusive"]:
            _open_and_stop(values)


@contextmanager
def hand_over(device: str) -> Iterator[None]:
    """While the block opens this device: its lock is free, and the first opening ends after the block's."""
    while _opened:
        held, descriptor = _opened.pop()
        try:
            if held == device:
                fcntl.flock(descriptor, fcntl.LOCK_UN)
                yield
                return
        finally:
            os.close(descriptor)
    yield


def read_link(arguments: Sequence[str], environment: Mapping[str, str]) -> dict[str, Any] | None:
    """The keys of ``DEFAULTS`` as `chefbotd run` with these arguments will have them; None where that is not plain.

    Raises:
        OSError: a file cannot be read.
        ValueError: a file is not TOML.
    """
    options = _options(arguments)
    if options is None:
        return None
    config = options.get("--config", "chefbot")
    path = Path(config) if Path(config).is_file() else packaged_folder() / f"{config}.toml"
    sections = _read_sections(path)
    if sections is None or not _override(sections, environment):
        return None
    values = {key: value for name in DEFAULTS for key, value in sections[name].items()}
    values["device"] = options.get("--port", values["device"])
    expected = {key: type(value) for section in DEFAULTS.values() for key, value in section.items()}
    is_plain = all(type(values[key]) is kind for key, kind in expected.items())
    return {key: values[key] for key in expected} if is_plain else None


def _options(arguments: Sequence[str]) -> dict[str, str] | None:
    """The options of a plain `chefbotd run`; None of another command, and where one is not known here."""
    if not arguments or arguments[0] != "run":
        return None
    rest = list(arguments[1:])
    options: dict[str, str] = {}
    while rest:
        name, has_equals, value = rest.pop(0).partition("=")
        if name not in OF_RUN or bool(has_equals) > OF_RUN[name]:
            return None
        if OF_RUN[name] and not has_equals:
            if not rest:
                return None
            value = rest.pop(0)
        options[name] = value
    return options


def _read_sections(path: Path) -> dict[str, dict[str, Any]] | None:
    """The sections of a file, over those of the robots that it extends, over the defaults."""
    files: list[dict[str, Any]] = []
    for _ in range(DEEPEST):
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > MOST_BYTES:
            return None
        values = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
        files.insert(0, values)
        base = values.get("extends")
        if base is None:
            break
        path = packaged_folder() / f"{base}.toml"
        if path.parent != packaged_folder():
            return None
    else:
        return None
    sections = {name: dict(defaults) for name, defaults in DEFAULTS.items()}
    for values in files:
        for name, section in sections.items():
            own = values.get(name, {})
            if not isinstance(own, dict):
                return None
            section.update(own)
    return sections


def _override(sections: dict[str, dict[str, Any]], environment: Mapping[str, str]) -> bool:
    """Set what the environment sets; False where a variable sets a whole section."""
    for variable, text in environment.items():
        name = variable.lower().removeprefix(PREFIX) if variable.startswith(PREFIX.upper()) else ""
        section, has_key, key = name.partition("__")
        if section in sections:
            if not has_key:
                return False
            sections[section][key] = _read_value(text)
    return True


def _read_value(text: str) -> Any:
    """The value of a variable's text, as ``settings`` reads it."""
    try:
        return tomllib.loads(f"value = {text}").get("value", text)
    except ValueError:
        return text


def _open_and_stop(values: Mapping[str, Any]) -> None:
    """Open and lock the device, set it up as pyserial does, and write the stops."""
    stop, speed = STOPS.get(values["wire"]), getattr(termios, f"B{values['baud']}", None)
    if stop is None or speed is None or "://" in values["device"]:
        return
    descriptor = os.open(values["device"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _set_up(descriptor, speed, hang_up=values["hang_up_on_close"])
        for line, is_set in ((termios.TIOCM_DTR, values["dtr"]), (termios.TIOCM_RTS, values["rts"])):
            with suppress(OSError):  # a pseudo-terminal has neither
                request = termios.TIOCMBIS if is_set else termios.TIOCMBIC
                fcntl.ioctl(descriptor, request, struct.pack("I", line))
        os.write(descriptor, stop * FIRST_STOPS)
    except BaseException:
        os.close(descriptor)
        raise
    _opened.append((values["device"], descriptor))


def _set_up(descriptor: int, speed: int, *, hang_up: bool) -> None:
    """Raw, 8N1, at this speed; raises ``termios.error`` for what is no terminal."""
    settings = termios.tcgetattr(descriptor)
    control = settings[2] & ~(
        termios.CSIZE | termios.CSTOPB | termios.PARENB | termios.CRTSCTS | termios.HUPCL
    )
    control |= termios.CLOCAL | termios.CREAD | termios.CS8 | (termios.HUPCL if hang_up else 0)
    settings[0] = settings[1] = settings[3] = 0
    settings[2], settings[4], settings[5] = control, speed, speed
    termios.tcsetattr(descriptor, termios.TCSANOW, settings)
