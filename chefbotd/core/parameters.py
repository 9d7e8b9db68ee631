"""The base class of parameter sets, which stand beside their algorithm and are checked when they are made."""

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field


class Parameters(BaseModel):
    """A frozen set of parameters; unknown keys, non-finite numbers and bad ranges raise ``ValidationError``.

    Field names carry their unit. Where the API's name is shorter than the configuration's (``kp`` for
    ``kp_duty_per_m_s``), the longer one is the field's alias and both are accepted.
    """

    retired: ClassVar[Mapping[str, Any]] = {}
    """Keys of earlier versions that are constants now, with their values; those of a table by its name."""

    # What checks a class is built when the class is first used by itself: most are checked as a part of another.
    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True, defer_build=True
    )


def section() -> Any:
    """A field of parameters that may be left out: each of its keys has its default then.

    An instance as the default would build the class's own check at import, which costs the daemon's start a millisecond.
    """
    return Field(default_factory=dict, validate_default=True)


SOCKET = "socket://"
_ADDRESS = re.compile(r"(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})")
MOST_PORT = 65535


def check_device(device: str, example: str) -> str:
    """A serial device's path, or ``socket://host:port``, as it is.

    The other addresses of pyserial (``loop://``, ``rfc2217://``) have no descriptor that a loop could watch.

    Raises:
        ValueError: it is neither; the message has what was expected.
    """
    if "://" not in device:
        return device
    expected = f"expected a path such as {example} or socket://host:port, got {device!r}"
    if not device.startswith(SOCKET):
        raise ValueError(expected)
    address = _ADDRESS.fullmatch(device.removeprefix(SOCKET))
    if address is None:
        raise ValueError(expected)
    if not 1 <= int(address["port"]) <= MOST_PORT:
        raise ValueError(f"expected a port from 1 to {MOST_PORT}, got {address['port']} in {device!r}")
    return device
