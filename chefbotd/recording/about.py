"""What every recording says about the robot: software versions and the configuration."""

import platform
from collections.abc import Callable
from functools import cache

from chefbotd import __version__
from chefbotd.recording.status import About

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
