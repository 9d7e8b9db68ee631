"""A scan as a value, from a lidar's turn or a depth image. Loads no numpy: only who makes or reads a scan does."""

from typing import TYPE_CHECKING, Any, TypeAlias

from chefbotd.core.record import Record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats: TypeAlias = NDArray[np.float64]
else:
    Floats = Any


class LaserScan(Record, frozen=True):
    """One turn, in the order in which it was measured; bearings are counter-clockwise in the lidar's frame.

    ``range_m`` is 0, infinite or NaN where there was no reading. ``stamp_s`` is the time of the scan, and ``after_s``
    how long after it each beam was measured (negative: before).

    Raises:
        ValueError: the arrays are not of one length.
    """

    stamp_s: float
    bearing_rad: Floats
    range_m: Floats
    after_s: Floats

    def __post_init__(self) -> None:
        sizes = {self.bearing_rad.shape, self.range_m.shape, self.after_s.shape}
        if len(sizes) != 1 or self.range_m.ndim != 1:
            raise ValueError(f"bearings, ranges and times are of one length, got shapes {sorted(sizes)}")
