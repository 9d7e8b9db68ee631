"""The base class of values that are made at the rate of the encoders: events, and states between two steps."""

from msgspec import Struct
from msgspec.structs import replace

__all__ = ["Record", "replace"]


class Record(Struct, frozen=True, gc=False):
    """A value that never changes, with named fields; ``replace`` makes another with some of them changed.

    It takes a tenth of a dataclass's time to make, and the garbage collector never looks into it: so a record must not
    hold anything that leads back to it.
    """
