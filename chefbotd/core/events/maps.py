"""Which map the robot uses. The map itself is in the store (``chefbotd.maps``), for whoever needs its cells."""

from chefbotd.core.record import Record


class MapLoaded(Record, frozen=True):
    """From now on this version of this map of the store in ``folder`` is the one in use."""

    stamp_s: float
    folder: str
    name: str
    version: int


class MapUnloaded(Record, frozen=True):
    """The map that was in use has been deleted; none is in use."""

    stamp_s: float
    name: str
