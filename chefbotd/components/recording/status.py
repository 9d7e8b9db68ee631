"""The recorder's state and its reports. Loads none of the libraries that write files."""

import platform
from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated

from msgspec import Meta, Struct

from chefbotd import __version__
from chefbotd.core.commands import Refused
from chefbotd.core.record import Record


class RecordingError(Refused):
    """The recorder did not do what was asked; what was recorded before is as it was."""


class UnreadableRecording(Exception):
    """A file is no recording, or nothing of it can be read."""


AUTOMATIC, FAULT = "auto", "fault"
"""How the names of files begin that nobody asked for; the oldest of them give way to newer ones."""

RING = "ring"
"""The prefix of files with the last minutes that a client asked for."""


class About(Struct, frozen=True):
    """What is written into every file: metadata by name, and the robot's description. Neither has a secret."""

    metadata: Mapping[str, Mapping[str, str]]
    urdf: str | None = None


class RecordedFile(Record, frozen=True):
    """A file in the folder. One that is not ``complete`` can be read up to where its writer ended."""

    file: str
    size_bytes: int
    changed_at_s: Annotated[float, Meta(description="seconds since 1970, UTC")]
    complete: bool
    recording: bool


PACKAGES = (
    "chefbotd",
    "mcap",
    "msgspec",
    "numba",
    "numpy",
    "pydantic",
    "pyserial",
    "scipy",
    "uvloop",
    "zstandard",
)


def about_robot(name: str, session: str, configuration: Callable[[], str], urdf: str | None) -> About:
    """``configuration`` gives the configuration as JSON. It has paths of tokens and keys, and never what is in them."""
    computer = {
        "chefbotd": __version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "robot": name,
        "session": session,
    }
    metadata = {"chefbotd": computer, "packages": _versions(), "configuration": {"json": configuration()}}
    return About(metadata, urdf)


@cache
def _versions() -> dict[str, str]:
    from importlib import metadata  # large, and not needed before the first file

    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions
