"""Maps: which one is in use, and the one that is being made. Loads no numpy."""

from typing import Annotated, ClassVar

from msgspec import Meta

from chefbotd.core.grid_patch import GridPatch
from chefbotd.core.record import Level, LogLine, Record, state_line
from chefbotd.core.sentence import Sentence


class MapChanged(GridPatch, frozen=True):
    """Changed cells of the map that is being made, or all of them (``whole``), which replace earlier ones.

    Cells are percentages, -1 for unknown. Revisions count up by one; a gap means that a change is missing.
    """

    drawn_as: ClassVar[str] = "map"

    whole: bool


class MappingData(Record, frozen=True):
    """The state of mapping; ``reason`` says what is wrong, if anything is."""

    state: Annotated[str, Meta(description="idle, mapping, paused or finishing")] = "idle"
    name: Annotated[str | None, Meta(description="the map that is being extended")] = None
    keyframes: int = 0
    loops: int = 0
    path_m: float = 0.0
    scans: int = 0
    unfinished: Annotated[bool, Meta(description="there is an unfinished map on the disk")] = False
    reason: str = ""
    warning: Annotated[str | None, Meta(description="what is lost of the unfinished map")] = None


class MappingChanged(MappingData, frozen=True, kw_only=True):
    """The state of mapping has changed. An empty ``warning`` is none."""

    retained: ClassVar[bool] = True

    stamp_s: float

    def log_line(self) -> LogLine:
        """The line in the log."""
        return state_line("mapping", self.state, self.reason)


class MapSaved(Record, frozen=True):
    """The map was saved. ``finish_mapping`` answers with this."""

    name: str
    version: int
    keyframes: int
    loops: int
    path_m: float


class MapLoaded(Record, frozen=True):
    """The map in use is now this version of this map, in the store in ``folder``.

    ``renamed_from`` is the name that the same map had until now; None: it is another map, or another version.
    """

    drawn_as: ClassVar[str] = "map"

    retained: ClassVar[bool] = True

    stamp_s: float
    folder: str
    name: str
    version: int
    renamed_from: str | None = None

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(
            Level.INFO,
            "maps",
            Sentence(
                "maps.in_use", "{map}, version {version}, is in use", map=self.name, version=self.version
            ),
        )


class MapUnloaded(Record, frozen=True):
    """The map that was in use has been deleted, or is not used any more for this ``reason``; none is in use."""

    stamp_s: float
    name: str
    reason: str = ""
