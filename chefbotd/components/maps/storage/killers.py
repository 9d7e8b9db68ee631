"""A map that ended the worker is remembered on the disk: it is not loaded again by itself."""

from typing import Final, Literal

from pydantic import Field, ValidationError

from chefbotd.core.parameters import Parameters

KILLED: Final = "killed_worker.json"
"""Beside the map's versions."""


class KilledWorker(Parameters):
    """This version was in use when the worker ended, and how that was."""

    format: Literal[1] = 1
    version: int
    reason: str = Field(max_length=2000)


def killed_to_file(version: int, reason: str) -> bytes:
    """The content of the file."""
    return KilledWorker(version=version, reason=reason[:2000]).model_dump_json().encode()


def why_it_ended(content: bytes | None, version: int | None) -> str:
    """How this version ended the worker; empty where it did not, or the file is damaged."""
    if content is None:
        return ""
    try:
        killed = KilledWorker.model_validate_json(content)
    except ValidationError:
        return ""
    return f"version {version} ended the worker: {killed.reason}" if killed.version == version else ""
