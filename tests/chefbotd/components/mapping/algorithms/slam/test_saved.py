"""What is saved is restored, and what is not a saved state is refused with its reason."""

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.saved import Arrays, NotASavedState, restore_state, save_state
from chefbotd.components.mapping.algorithms.state import Scan, SlamState, start
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.drives import drive
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
)

TRUTH = poses_along(TOUR)[:60]


@pytest.fixture(scope="module")
def driven() -> SlamState:
    """The first metres of a tour."""
    lidar = Lidar(furnished_flat(), 1)
    return drive(odometry(TRUTH, 1), lambda k: lidar.points(TRUTH[k]), finish=False).state


def test_everything_is_restored(driven: SlamState) -> None:
    """Each array of the restored state, saved again, is the same; the growing grids too."""
    arrays = save_state(driven)
    again = save_state(restore_state(arrays))
    assert arrays.keys() == again.keys()
    for name, array in arrays.items():
        assert np.array_equal(array, again[name]), name
        assert array.dtype == again[name].dtype, name
    back = restore_state(arrays)
    for one, other in zip(driven.active, back.active, strict=True):
        for grid, same in zip(one.grids, other.grids, strict=True):
            assert np.array_equal(grid, same)


def test_each_point_is_restored_with_the_lidar_that_saw_it(driven: SlamState) -> None:
    """Two lidars' scan among those of one keeps a place for each point; an older file, of one lidar, is read too."""
    nodes = driven.nodes
    places = np.repeat([[0.2, 0.0], [-0.2, 0.1]], [100, len(nodes.scans[1].points) - 100], axis=0)
    places = places.astype(np.float32)
    points = nodes.scans[1].points
    both = Scan(points, normals(points, places), places)
    state = replace(driven, nodes=replace(nodes, scans=(nodes.scans[0], both, *nodes.scans[2:])))
    back = restore_state(save_state(state)).nodes.scans
    assert np.array_equal(back[1].sensor_m, places)
    assert back[1].sensor_m.dtype == np.float32
    assert np.array_equal(back[1].facing, both.facing)
    assert back[2].sensor_m.tolist() == [0.0, 0.0]
    older = restore_state(without(save_state(driven), "sensor_sizes")).nodes.scans
    assert np.array_equal([scan.sensor_m for scan in older], [scan.sensor_m for scan in nodes.scans])


def test_an_empty_state_is_restored() -> None:
    """Saved before the first scan, it begins anew."""
    assert len(restore_state(save_state(start())).nodes) == 0


def without(arrays: Arrays, name: str) -> Arrays:
    """All but one."""
    return {key: array for key, array in arrays.items() if key != name}


@pytest.mark.parametrize(("old", "new"), [("slipped", "wheel_slip"), ("doubtful", "uncertain")])
def test_a_mode_of_an_earlier_version_has_its_name_of_today(driven: SlamState, old: str, new: str) -> None:
    """A map that was left unfinished by an earlier version can be gone on with."""
    assert restore_state(save_state(driven) | {"mode": np.array(old)}).mode == new


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda arrays: without(arrays, "node_map"), "node_map"),
        (lambda arrays: arrays | {"format": np.array(7)}, "format 1, got 7"),
        (lambda arrays: arrays | {"sensor_sizes": 2 * arrays["sensor_sizes"]}, "seen from"),
        (lambda arrays: arrays | {"scan_points": arrays["scan_points"][:-1]}, "points"),
        (lambda arrays: arrays | {"node_path_m": arrays["node_path_m"][:-1]}, "each node has a scan"),
    ],
)
def test_what_is_not_a_saved_state_is_refused(driven: SlamState, change: object, reason: str) -> None:
    """The reason names what is missing or does not fit."""
    assert callable(change)
    with pytest.raises(NotASavedState, match=reason):
        restore_state(change(save_state(driven)))


def test_a_map_of_nothing_is_refused() -> None:
    """With a sentence that says what is missing."""
    with pytest.raises(ValueError, match="a map is made of scans, but there are none"):
        occupancy(start().nodes)
