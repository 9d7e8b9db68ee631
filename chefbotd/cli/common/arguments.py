"""The formats of command-line arguments: each function is a click type and refuses a bad value as a usage error."""

import math
from pathlib import Path

import click

from chefbotd.core.record import Record

NUMBERS_MAY_BE_NEGATIVE = {"ignore_unknown_options": True}
"""Context settings of a command whose arguments are numbers, so that ``-0.1`` is not taken for an option."""


class Address(Record, frozen=True):
    """Where a daemon listens."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


PHYSICS = click.Choice(["planar", "mujoco"])
"""What may move a simulated robot."""


def address(text: str) -> Address:
    """``HOST:PORT`` or ``[IPV6]:PORT``."""
    host, _, port = text.rpartition(":")
    bare = host.removeprefix("[").removesuffix("]")
    if not bare or (":" in bare and bare == host) or not _is_port(port):
        raise click.BadParameter(f"{text!r} is not HOST:PORT with a port from 0 to 65535")
    return Address(bare, int(port))


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdigit() and int(text) <= 65535


def configuration(text: str) -> Path:
    """A robot's TOML file, or the name of a robot whose configuration comes with chefbotd."""
    path = Path(text)
    if path.is_file():
        return path
    if path.is_dir():
        inside = sorted(path.glob("*.toml"))
        advice = f", such as {inside[0]} in it" if inside else ""
        raise click.BadParameter(f"{text} is a folder, expected a TOML file{advice}")
    if path.suffix or len(path.parts) > 1:
        raise click.BadParameter(f"there is no file {text}")
    from chefbotd.settings import SettingsError, packaged  # imported here: most commands do not need it

    try:
        return packaged(text)
    except SettingsError as error:
        raise click.BadParameter(str(error)) from error


def finite(text: str | float) -> float:
    """A number that is not infinite."""
    try:
        number = float(text)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a number") from None
    if not math.isfinite(number):
        raise click.BadParameter(f"{text!r} is not finite")
    return number


def positive(text: str | float) -> float:
    """A finite number above zero."""
    number = finite(text)
    if number <= 0:
        raise click.BadParameter(f"{text!r} is not above zero")
    return number


UNITS_S = {"s": 1.0, "m": 60.0, "h": 3600.0}


def duration(text: str | float) -> float:
    """Seconds above zero: ``10``, ``10s``, ``1.5m`` or ``2h``."""
    unit = str(text)[-1:]
    number = str(text)[:-1] if unit in UNITS_S else str(text)
    try:
        return positive(number) * UNITS_S.get(unit, 1.0)
    except click.BadParameter:
        raise click.BadParameter(f"{text!r} is not a time above zero, such as 10s, 5m or 1h") from None


def wheel_speed(text: str) -> tuple[str, float]:
    """``NAME=RAD_S``: a wheel and a finite speed."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise click.BadParameter(f"{text!r} is not NAME=RAD_S, such as left_wheel=3.5")
    return name, finite(value)


GAIN_WORDS: dict[str, object] = {"true": True, "false": False, "none": None}


def gain(text: str) -> tuple[str, object]:
    """``NAME=VALUE``: a gain by its short name, and a number, ``true``, ``false`` or ``none``."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise click.BadParameter(f"{text!r} is not NAME=VALUE, such as kp=400")
    return name, GAIN_WORDS[value] if value in GAIN_WORDS else finite(value)
