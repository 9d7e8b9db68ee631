"""A smooth curve through measured points that never turns between them."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise


class MonotoneCurve:
    """Piecewise cubic Hermite interpolation that keeps the data's monotony, flat beyond both ends.

    Method: Fritsch and Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17, 1980, with the slopes
    of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984) and the end slopes of Moler, *Numerical Computing with
    MATLAB*, 3.4.
    """

    def __init__(self, points: Sequence[tuple[float, float]]) -> None:
        """Raises ``ValueError`` unless there are two points or more, (x, y), with increasing x."""
        if len(points) < 2 or any(a[0] >= b[0] for a, b in pairwise(points)):
            raise ValueError(f"a curve needs two points or more with increasing x, got {list(points)}")
        self._x = [x for x, _ in points]
        self._y = [y for _, y in points]
        self._slopes = _slopes(self._x, self._y)

    def at(self, x: float) -> float:
        """The curve's value; beyond its ends that of the nearest one."""
        if x <= self._x[0]:
            return self._y[0]
        if x >= self._x[-1]:
            return self._y[-1]
        k = bisect_right(self._x, x) - 1
        width = self._x[k + 1] - self._x[k]
        t = (x - self._x[k]) / width
        from_left = (1 + 2 * t) * self._y[k] + t * width * self._slopes[k]
        from_right = (3 - 2 * t) * self._y[k + 1] + (t - 1) * width * self._slopes[k + 1]
        return (1 - t) ** 2 * from_left + t**2 * from_right


def _slopes(x: Sequence[float], y: Sequence[float]) -> list[float]:
    """The slope of the curve at every point."""
    widths = [b - a for a, b in pairwise(x)]
    rises = [(b - a) / width for (a, b), width in zip(pairwise(y), widths, strict=True)]
    if len(rises) == 1:
        return [rises[0], rises[0]]
    inner = [_inner_slope(*each) for each in zip(pairwise(widths), pairwise(rises), strict=True)]
    first = _end_slope(widths[0], widths[1], rises[0], rises[1])
    last = _end_slope(widths[-1], widths[-2], rises[-1], rises[-2])
    return [first, *inner, last]


def _inner_slope(widths: tuple[float, float], rises: tuple[float, float]) -> float:
    """A weighted harmonic mean of the rises on both sides; level where they differ in sign."""
    (left_width, right_width), (left, right) = widths, rises
    if left * right <= 0:
        return 0.0
    left_weight, right_weight = 2 * right_width + left_width, right_width + 2 * left_width
    return (left_weight + right_weight) / (left_weight / left + right_weight / right)


def _end_slope(width: float, next_width: float, rise: float, next_rise: float) -> float:
    """A three-point estimate, limited so that the end stays monotone."""
    slope = ((2 * width + next_width) * rise - width * next_rise) / (width + next_width)
    if slope * rise <= 0:
        return 0.0
    if rise * next_rise < 0 and abs(slope) > 3 * abs(rise):
        return 3 * rise
    return slope
