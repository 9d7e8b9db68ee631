"""Parts of a map that are not connected: after a kidnapping, or when a saved map is gone on with from anywhere."""

import math

import numpy as np

from chefbotd.core.record import replace
from chefbotd.mapping.local_map import empty
from chefbotd.mapping.poses import Floats, compose
from chefbotd.mapping.state import Active, SlamMode, SlamState, Submap


def apart(state: SlamState) -> SlamState:
    """Begin a part of its own: the robot may be anywhere, as after a kidnapping or when going on with a saved map.

    A part that was never joined is forgotten.
    """
    last = len(state.nodes) - 1
    ended = tuple(Submap(a.first, last) for a in state.active[:1] if a.first <= last)
    state = replace(state, submaps=state.submaps + ended, active=(), candidates=())
    if state.part:
        state = _without_part(state, state.part)
    return replace(
        state,
        part=state.part + 1,
        active=(Active(len(state.nodes), 0.0, empty()),),
        mode=SlamMode.LOST,
        misfits=0,
        tried_at_m=-math.inf,
        built=(),
        searching=None,
    )


def _without_part(state: SlamState, part: int) -> SlamState:
    """Forget the nodes of a part; they are the last ones."""
    count = int(np.searchsorted(state.nodes.part, part))
    kept = state.edges.only((state.edges.first < count) & (state.edges.second < count))
    submaps = tuple(s for s in state.submaps if s.last < count)
    return replace(state, nodes=state.nodes.only(np.arange(count)), edges=kept, submaps=submaps)


def joined(state: SlamState, correction: Floats) -> SlamState:
    """Move the part that was apart to where it belongs; its nodes are the map's now."""
    nodes, moved = state.nodes, state.nodes.part == state.part
    poses = np.where(moved[:, None], compose(correction, nodes.map), nodes.map)
    joined = replace(nodes, map=poses, part=np.zeros_like(nodes.part))
    return replace(
        state, nodes=joined, part=0, mode=SlamMode.MAPPING, candidates=(), built=(), searching=None
    )
