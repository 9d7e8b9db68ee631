"""The parameters of recording: what, where, and how much."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.storage import state_folder


class RecordingParameters(Parameters):
    """Without a ``folder``, files are in ``recordings`` of the folder that systemd gives the service, or the user's."""

    enabled: bool = Field(
        True,
        description="Files may be written, and the last minutes are kept in memory; it needs the extra 'recording'",
    )
    folder: Path | None = Field(
        None,
        description="The folder for files, from the configuration's; left out: the service's state folder, or your own",
    )
    auto_start: bool = Field(
        False,
        description="A recording begins with the daemon; one that begins later is replayed from its first state",
    )
    rotate_mb: float = Field(256.0, ge=0.1, le=1e6, description="After so much a new file begins")
    rotate_minutes: float = Field(30.0, gt=0.0, le=1e5, description="After so long a new file begins")
    min_free_mb: float = Field(
        500.0,
        ge=0.0,
        le=1e7,
        description="Before less of the disk is free, old automatic files are removed, or recording ends",
    )
    automatic_mb: float = Field(
        2000.0,
        ge=1.0,
        le=1e7,
        description="The most that automatic recordings take; the oldest are removed",
    )
    ring_s: float = Field(
        120.0,
        ge=0.0,
        le=3600.0,
        description="The last seconds, kept in memory, which a fault writes into a file; 0: none",
    )
    ring_mb: float = Field(16.0, ge=0.1, le=4096.0, description="The most memory that they take, compressed")
    after_fault_s: float = Field(
        3.0, ge=0.0, le=60.0, description="How long a fault's file goes on after the fault"
    )
    exclude: frozenset[str] = Field(frozenset(), description="The classes of events that are not recorded")
    compression: Literal["zstd", "lz4"] = "zstd"
    """How chunks are compressed."""
    chunk_s: float = Field(
        1.0,
        ge=0.05,
        le=60.0,
        description="So much is written at a time: a kill or a power cut loses this much at most",
    )
    sync_s: float = Field(
        5.0,
        ge=0.0,
        le=600.0,
        description="The file is brought to the disk so often: a power cut loses this much more",
    )
    queue_mb: float = Field(
        16.0, ge=0.1, le=4096.0, description="The buffer for a disk that is slow or hangs"
    )


def folder_of(
    parameters: RecordingParameters, environment: Mapping[str, str], *, simulated: bool = False
) -> Path:
    """The configured folder; else the one for state: see ``state_folder``."""
    return parameters.folder or state_folder("recordings", environment, simulated=simulated)
