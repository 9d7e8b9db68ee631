"""The compiled beams are those that numpy casts, to the bit."""

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from chefbotd.components.simulation import compiled_beams, world
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.world import RayCaster

WALLS = st.integers(1, 12).flatmap(
    lambda count: st.lists(
        st.tuples(*[st.integers(-4, 4)] * 4).filter(lambda w: w[:2] != w[2:]), min_size=count, max_size=count
    )
)


@given(WALLS, st.integers(0, 2**32 - 1))
def test_each_beam_has_the_same_length_wall_and_angle(edges: list[tuple[int, ...]], seed: int) -> None:
    """Also along a wall, through its end, and from a place on it: half of the beams go along an axis."""
    chance, rows = np.random.default_rng(seed), np.array(edges, float)
    along = rows[:, 2:] - rows[:, :2]
    walls = np.vstack((rows[:, :2].T, along.T, np.hypot(*along.T)))
    origins = np.where(
        chance.random((20, 2)) < 0.5, chance.integers(-4, 5, (20, 2)), chance.normal(0, 2, (20, 2))
    )
    bearings = np.where(
        chance.random(20) < 0.5, chance.integers(0, 4, 20) * np.pi / 2, chance.uniform(0, 7, 20)
    )
    beams = (origins, np.cos(bearings), np.sin(bearings))
    expected, found = world.find_nearest(walls, *beams), compiled_beams.find_nearest(walls, *beams)
    assert [array.tobytes() for array in found] == [array.tobytes() for array in expected]


def test_beams_are_compiled_where_the_compiler_is_loaded_anyway() -> None:
    """As in a process that runs a worker too."""
    edges, _ = scene_of(Path("flat")).slice(0.2)
    caster = RayCaster(edges, 12.0)
    caster.cast(np.full((3, 2), 2.0), np.array([0.1, 0.2, 0.3]))
    assert caster._find_nearest is compiled_beams.find_nearest
