"""Makes what records, in the thread that writes: all that it needs is loaded there."""

import gc
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import Struct

from chefbotd.core.commands import Refused
from chefbotd.core.events.mapping import MapLoaded
from chefbotd.core.geometry import Pose2D
from chefbotd.recording.parameters import RecordingParameters

if TYPE_CHECKING:
    from chefbotd.recording.chunk_encoder import ChunkEncoder
    from chefbotd.recording.foxglove import Cells
    from chefbotd.recording.recorder import Recorder
    from chefbotd.recording.writer import MakeRecorder


class Made(Struct, frozen=True):
    """What a recording says of the robot. ``first_scanner`` is whose scans are on ``/scan``."""

    robot: str
    session: str
    configuration: Callable[[], str]
    urdf: Callable[[], str | None]
    first_scanner: str | None


def recorder_maker(
    parameters: RecordingParameters, folder: Path, made: Made, started_s: float
) -> "MakeRecorder":
    """What makes encoder and recorder; ``started_s`` is the daemon's time now."""
    offset_ns = time.time_ns() - round(started_s * 1e9)

    def make() -> "tuple[ChunkEncoder, Recorder]":
        from chefbotd.recording.about import about_robot
        from chefbotd.recording.channels import Channels
        from chefbotd.recording.chunk_encoder import ChunkEncoder
        from chefbotd.recording.recorder import Recorder

        gc.freeze()  # as after the start: no collection looks at all these classes
        encoder = ChunkEncoder(Channels(), offset_ns, made.first_scanner, parameters.chunk_s, started_s)
        recorder = Recorder(
            parameters,
            folder,
            encoder.channels,
            offset_ns,
            about=lambda: about_robot(made.robot, made.session, made.configuration, made.urdf()),
            read_map=read_map,
        )
        return encoder, recorder

    return make


def read_map(event: MapLoaded) -> "Cells | None":
    """The cells of the map that is in use from now on; None where they cannot be read."""
    from chefbotd.maps.manifest import CELLS
    from chefbotd.maps.store import MapStore

    try:
        manifest, data = MapStore(Path(event.folder), 1).read_file(event.name, CELLS)
        cells = zlib.decompress(data)
    except (Refused, OSError, zlib.error):
        return None
    extent = manifest.extent
    origin = Pose2D(extent.x_m, extent.y_m, extent.heading_rad)
    return extent.resolution_m, origin, extent.columns, cells
