"""The recorder's state and its reports. Loads none of the libraries that write files."""

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

AUTOMATIC, FAULT = "auto", "fault"
"""How the names of files begin that nobody asked for; the oldest of them give way to newer ones."""

RING = "ring"
"""How those begin that have the last minutes because somebody asked for them."""

State = Literal["idle", "recording", "failed"]


class About(Struct, frozen=True):
    """What is written into every file: metadata by name, and the robot's description. Neither has a secret."""

    metadata: Mapping[str, Mapping[str, str]]
    urdf: str | None = None


class Status(Struct, frozen=True):
    """How the recorder stands; the fields are those of ``RecordingChanged``."""

    state: State = "idle"
    name: str | None = None
    file: str | None = None
    seconds: float = 0.0
    bytes_written: int = 0
    messages: int = 0
    ring_s: float = 0.0
    ring_bytes: int = 0
    free_bytes: int | None = None
    saved: str | None = None
    reason: str = ""


class Stored(Struct, frozen=True):
    """A file in the folder. ``complete``: it has its summary; one that has not can be read up to its last chunk."""

    file: str
    size_bytes: int
    changed_at_s: float
    complete: bool
    recording: bool
