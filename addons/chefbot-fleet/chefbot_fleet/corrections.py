"""Changes of the roadmap by hand."""

from collections.abc import Iterable

from chefbot_fleet.lanes import Space
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.store import Correction

FARTHEST_M = 1e5
"""No place of a map is farther from its origin."""


def corrected(roadmap: Roadmap, corrections: Iterable[Correction]) -> Roadmap:
    """The roadmap after these. Raises ``ValueError`` for one that makes no sense."""
    for one in corrections:
        if one.kind == "add edge":
            roadmap = roadmap.with_edge(one.a, one.b)
        elif one.kind == "remove edge":
            roadmap = roadmap.without_edge(one.a, one.b)
        elif one.kind == "add place":
            roadmap = roadmap.with_node((one.x_m, one.y_m), one.a)
        else:
            raise ValueError(f"{one.kind!a}: expected 'add edge', 'remove edge' or 'add place'")
    return roadmap


def check_way(correction: Correction, roadmap: Roadmap, space: Space | None) -> None:
    """A new edge, or the one to a new place, leads where a robot has its clearance, by the map; else ``ValueError``."""
    count = len(roadmap.points_m)
    if space is None or correction.kind == "remove edge" or not 0 <= correction.a < count:
        return
    start, end = roadmap.points_m[correction.a], (correction.x_m, correction.y_m)
    if correction.kind == "add edge":
        if not 0 <= correction.b < count:
            return
        end = roadmap.points_m[correction.b]
    if max(map(abs, end)) > FARTHEST_M or not space.has_way(start, end):
        from_to = f"from ({start[0]:.2f}, {start[1]:.2f}) to ({end[0]:.6g}, {end[1]:.6g})"
        raise ValueError(f"no robot can drive straight {from_to}: by the map something is in the way")
