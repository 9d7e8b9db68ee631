"""The parameters of recording: what, where, and how much."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.storage import state_folder


class RecordingParameters(Parameters):
    """Without a ``folder``, files are in ``recordings`` of the folder that systemd gives the service, or the user's."""

    enabled: bool = Field(True, description="where the extra 'recording' is installed; false: no ring either")
    folder: Path | None = Field(
        None, description="where files are written; a relative path begins at the configuration's folder"
    )
    auto_start: bool = Field(
        False, description="record from the daemon's start on; only such a file can be replayed"
    )
    rotate_mb: float = Field(256.0, ge=0.1, le=1e6, description="then a new file begins")
    rotate_minutes: float = Field(30.0, gt=0.0, le=1e5, description="then a new file begins")
    min_free_mb: float = Field(
        500.0,
        ge=0.0,
        le=1e7,
        description="before less of the disk is free, old automatic files are removed, or recording ends",
    )
    automatic_mb: float = Field(
        2000.0,
        ge=1.0,
        le=1e7,
        description="of automatic recordings; the oldest are removed",
    )
    ring_s: float = Field(120.0, ge=0.0, le=3600.0, description="the last seconds, kept in memory; 0: none")
    ring_mb: float = Field(16.0, ge=0.1, le=4096.0, description="compressed, and no more than this")
    after_fault_s: float = Field(3.0, ge=0.0, le=60.0, description="how long after a fault its file goes on")
    exclude: frozenset[str] = Field(frozenset(), description="classes of events that are not recorded")
    compression: Literal["zstd", "lz4"] = "zstd"
    chunk_s: float = Field(
        1.0, ge=0.05, le=60.0, description="a kill or a power cut loses this much at most,"
    )
    sync_s: float = Field(5.0, ge=0.0, le=600.0, description="and a power cut this much more")
    queue_mb: float = Field(16.0, ge=0.1, le=4096.0, description="the buffer for a slow or hanging disk")


def folder_of(
    parameters: RecordingParameters, environment: Mapping[str, str], *, simulated: bool = False
) -> Path:
    """The configured folder; else the one for state: see ``state_folder``."""
    return parameters.folder or state_folder("recordings", environment, simulated=simulated)
