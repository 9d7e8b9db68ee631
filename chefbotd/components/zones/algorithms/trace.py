"""Outlines round the marked cells of a mask, which have exactly these cells in them; without holes.

The borders of cells are followed, and then replaced by straight lines that stay within less than half a cell: so every
cell whose middle is in an outline is one that is marked. What has a hole, or too many corners, is cut in two first.
"""

from collections.abc import Iterator
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Flags: TypeAlias = NDArray[np.bool_]
Floats: TypeAlias = NDArray[np.float64]
Corner: TypeAlias = tuple[int, int]

OFF_CELLS: Final = 0.36
"""An outline is nowhere farther from the borders of its cells, from which the middle of a cell is half a cell away.

A slope in steps of a cell becomes a straight line: the corners of its steps are sqrt(1/8) cells from it.
"""

LOOKED_BACK: Final = 2
"""A line that ends so many half cells earlier may let the next one go on farther, as on a slope."""

MOST_CORNERS: Final = 200


def trace_areas(mask: Flags, most_corners: int = MOST_CORNERS) -> Iterator[Floats]:
    """Outlines (n, 2) of (x, y) in cells from the outer corner of cell (0, 0), counter-clockwise."""
    for rows, columns, part in _parts(mask):
        for outline in _outlines(part, most_corners):
            yield outline + np.array([columns, rows])


def _outlines(part: Flags, most_corners: int) -> Iterator[Floats]:
    """The outlines of one part, whose cells join at their sides."""
    loops = _loops(part)
    hole = next((loop for loop in loops if _doubled_area(loop) < 0), None)
    outline = None if hole is not None else _straightened(loops[0])
    if outline is not None and len(outline) <= most_corners:
        yield outline
        return
    for rows, columns, piece in _cut(part, hole):
        for inner_rows, inner_columns, inner in _parts(piece):
            for one in _outlines(inner, most_corners):
                yield one + np.array([columns + inner_columns, rows + inner_rows])


def _cut(part: Flags, hole: Floats | None) -> Iterator[tuple[int, int, Flags]]:
    """A part cut in two: through a hole, or across its longer side; each with its first row and column."""
    rows, columns = part.shape
    if hole is not None:
        at = int(hole[:, 1].min() + hole[:, 1].max()) // 2
        yield from ((0, 0, part[:at]), (at, 0, part[at:]))
    elif rows >= columns:
        yield from ((0, 0, part[: rows // 2]), (rows // 2, 0, part[rows // 2 :]))
    else:
        yield from ((0, 0, part[:, : columns // 2]), (0, columns // 2, part[:, columns // 2 :]))


def _parts(mask: Flags) -> Iterator[tuple[int, int, Flags]]:
    """Each part whose cells join at their sides, cut out, with its first row and column."""
    padded = np.pad(mask, ((0, 0), (1, 1))).astype(np.int8)
    edges = np.diff(padded, axis=1)
    rows, firsts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    parent = list(range(len(rows)))
    _join_runs(rows.tolist(), firsts.tolist(), ends.tolist(), parent)
    runs: dict[int, list[int]] = {}
    for run in range(len(parent)):
        runs.setdefault(_root(parent, run), []).append(run)
    for own in runs.values():
        top, left = int(rows[own].min()), int(firsts[own].min())
        part = np.zeros((int(rows[own].max()) - top + 1, int(ends[own].max()) - left), np.bool_)
        for run in own:
            part[rows[run] - top, firsts[run] - left : ends[run] - left] = True
        yield top, left, part


def _join_runs(rows: list[int], firsts: list[int], ends: list[int], parent: list[int]) -> None:
    """Join each run of cells in a row with those in the row before that it touches."""
    above, run = 0, 0
    for run in range(len(rows)):
        while rows[above] < rows[run] - 1 or (rows[above] == rows[run] - 1 and ends[above] <= firsts[run]):
            above += 1
        other = above
        while rows[other] == rows[run] - 1 and firsts[other] < ends[run]:
            parent[_root(parent, other)] = _root(parent, run)
            other += 1


def _root(parent: list[int], run: int) -> int:
    while parent[run] != run:
        parent[run] = parent[parent[run]]
        run = parent[run]
    return run


def _loops(part: Flags) -> list[Floats]:
    """The borders of a part, its cells on the left, each from a corner of it on; that outside comes first."""
    following: dict[Corner, list[Corner]] = {}
    padded = np.pad(part, 1)
    for (dy, dx), start, end in _SIDES:
        ys, xs = np.nonzero(part & ~padded[1 + dy : 1 + dy + part.shape[0], 1 + dx : 1 + dx + part.shape[1]])
        for x, y in zip(xs.tolist(), ys.tolist(), strict=True):
            following.setdefault((x + start[0], y + start[1]), []).append((x + end[0], y + end[1]))
    loops = []
    while following:
        loops.append(_follow(following, min(following)))
    return sorted(loops, key=_doubled_area, reverse=True)


_SIDES: Final = (
    ((-1, 0), (0, 0), (1, 0)),
    ((0, 1), (1, 0), (1, 1)),
    ((1, 0), (1, 1), (0, 1)),
    ((0, -1), (0, 1), (0, 0)),
)
"""Of a cell: the neighbour on a side, and where that side begins and ends."""


def _follow(following: dict[Corner, list[Corner]], first: Corner) -> Floats:
    """One loop, whose sides are taken out; where two cells touch at a corner, along the same cell."""
    loop, at, came = [first], first, (0, 0)
    while True:
        ends = following[at]
        left = (at[0] - came[1], at[1] + came[0])
        end = left if left in ends else ends[0]
        ends.remove(end)
        if not ends:
            del following[at]
        came, at = (end[0] - at[0], end[1] - at[1]), end
        if at == first:
            return np.array(loop, np.float64)
        loop.append(at)


def _doubled_area(loop: Floats) -> float:
    x, y = loop.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _straightened(loop: Floats) -> Floats:
    """The loop by few straight lines, from point to point of it or from the middles of its sides."""
    closed = np.vstack([loop, loop[:1]])
    dense = np.empty((2 * len(loop) + 1, 2))
    dense[::2], dense[1::2] = closed, (closed[1:] + closed[:-1]) / 2
    kept, at = [0], 0
    last = len(dense) - 1
    while at < last:
        farthest = _farthest(dense, at)
        ends = range(max(at + 1, farthest - LOOKED_BACK), farthest + 1)
        at = farthest if farthest == last else max(ends, key=lambda end: _farthest(dense, end))
        kept.append(at)
    return np.asarray(dense[kept[:-1]])


def _farthest(points: Floats, start: int) -> int:
    """How far a straight line may go from here."""
    fits, step = start + 1, 1
    while fits + step < len(points) and _is_near(points[start : fits + step + 1]):
        fits, step = fits + step, 2 * step
    while step:
        if fits + step < len(points) and _is_near(points[start : fits + step + 1]):
            fits += step
        step //= 2
    return fits


def _is_near(points: Floats) -> bool:
    """Whether all points are near to the line from the first to the last."""
    along = points[-1] - points[0]
    away = points - points[0]
    share = np.clip(away @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return bool((np.hypot(*(away - share[:, None] * along).T) <= OFF_CELLS).all())
