"""SLAM in a simulated flat: the map is right, and stays right whatever happens to odometry, lidar and robot."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from chefbotd.components.mapping.algorithms.occupancy import occupancy
from chefbotd.components.mapping.algorithms.parameters import LoopParameters, SlamParameters
from chefbotd.components.mapping.algorithms.saved import restore_state, save_state
from chefbotd.components.mapping.algorithms.slam import step
from chefbotd.components.mapping.algorithms.state import Scan, SlamMode, SlamState, start, start_new_part
from chefbotd.core.poses import transform
from tests.chefbotd.components.mapping.algorithms.slam.drives import (
    PARAMS,
    Drive,
    drive,
    off_m,
    scan_of,
    walls_off_m,
)
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Floats,
    Lidar,
    box,
    furnished_flat,
    odometry,
    poses_along,
    walking,
    wall,
)

WALLS, TRUTH = furnished_flat(), poses_along(TOUR)
LOST = {"lost", "searching"}


def toured(seed: int, finish: bool = True, scans: int = len(TRUTH)) -> Drive:
    """The whole tour, or its first scans, with nothing special happening."""
    lidar = Lidar(WALLS, seed)
    return drive(odometry(TRUTH, seed)[:scans], lambda k: lidar.points(TRUTH[k]), finish=finish)


@pytest.fixture(scope="module")
def tour() -> Drive:
    """One for all the tests that only look at it."""
    return toured(3)


def test_the_odometry_alone_would_be_of_no_use() -> None:
    """It ends a metre and twenty degrees off, so what follows is not its merit."""
    assert off_m(odometry(TRUTH, 3), TRUTH)[-1] > 0.5
    assert abs(odometry(TRUTH, 3)[-1, 2] - (TRUTH[-1, 2] - TRUTH[0, 2])) > math.radians(20)


def test_the_map_lies_on_the_walls(tour: Drive) -> None:
    """Occupied cells are within 0.03 m of the true walls in the median, and within 0.06 m at p95."""
    off = walls_off_m(tour.state, TRUTH, WALLS)
    assert len(off) > 1000
    assert np.median(off) < 0.03
    assert np.percentile(off, 95) < 0.06


def test_every_pose_is_known_to_two_centimetres(tour: Drive) -> None:
    """The loops are closed: the second visit of each room agrees with the first."""
    assert sum(report.loops for report in tour.reports) > 10
    assert off_m(tour.poses(), TRUTH).max() < 0.02
    assert set(tour.modes()) == {"mapping"}


def test_a_scan_that_fits_says_so(tour: Drive) -> None:
    """Nearly all points lie on known surfaces where everything is right."""
    assert np.median([report.fit for report in tour.reports]) > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
def test_other_drives_of_the_flat_map_it_as_well(seed: int) -> None:
    """Nothing hangs on the seed of odometry and lidar."""
    found = toured(seed)
    assert np.median(walls_off_m(found.state, TRUTH, WALLS)) < 0.03
    assert off_m(found.poses(), TRUTH).max() < 0.03


@pytest.mark.slow
def test_the_same_input_gives_the_same_map_bit_for_bit(tour: Drive) -> None:
    """There is no clock, no order of a set and no chance in it."""
    again = toured(3)
    assert again.state.nodes.map.tobytes() == tour.state.nodes.map.tobytes()
    assert again.state.edges.information.tobytes() == tour.state.edges.information.tobytes()


@pytest.mark.slow
def test_a_saved_state_goes_on_as_if_nothing_had_been() -> None:
    """Saved in the middle, restored and driven on, the map is the same bit for bit."""
    middle, lidar, odom = 300, Lidar(WALLS, 5), odometry(TRUTH, 5)
    scans = [lidar.points(pose) for pose in TRUTH[:500]]
    whole = drive(odom[:500], lambda k: scans[k], finish=False)
    first = drive(odom[:middle], lambda k: scans[k], finish=False)
    kept = {name: array.copy() for name, array in save_state(first.state).items()}
    rest = drive(odom[middle:500], lambda k: scans[middle + k], restore_state(kept), finish=False)
    assert rest.state.nodes.map.tobytes() == whole.state.nodes.map.tobytes()
    assert rest.state.edges.pose.tobytes() == whole.state.edges.pose.tobytes()


@pytest.mark.slow
def test_people_who_walk_about_leave_no_smear() -> None:
    """Three people cross the rooms all the time: nothing is occupied away from walls, and poses stay right."""
    lidar, odom = Lidar(WALLS, 7), odometry(TRUTH, 7)
    people = list(
        walking(len(TRUTH), ((1.0, 3.9), (9.8, 3.8)), ((4.9, 5.2), (7.2, 6.9)), ((0.6, 1.5), (3.9, 2.6)))
    )
    apart_m = [np.hypot(*(who[:, :2] - pose[:2]).T) for who, pose in zip(people, TRUTH, strict=True)]
    seen = [who[away > 0.5] for who, away in zip(people, apart_m, strict=True)]
    found = drive(odom, lambda k: lidar.points(TRUTH[k], seen[k]))
    assert off_m(found.poses(), TRUTH).max() < 0.06
    off = walls_off_m(found.state, TRUTH, WALLS)
    assert (off > 0.15).sum() <= 3
    assert np.median(off) < 0.03


@pytest.mark.slow
def test_wheels_that_slip_are_told_and_survived() -> None:
    """At a doorstep the wheels roll on by 0.8 m and 0.5 rad while the robot stands: it says so, and the map stays."""
    lidar, odom, at = Lidar(WALLS, 9), odometry(TRUTH, 9), 210
    here, turn = odom[at - 1].copy(), 0.5
    cos, sin = math.cos(turn), math.sin(turn)
    odom[at:, :2] = (odom[at:, :2] - here[:2]) @ np.array([[cos, sin], [-sin, cos]]) + here[:2]
    odom[at:, 2] += turn
    odom[at:, :2] += 0.8 * np.array([math.cos(here[2]), math.sin(here[2])])
    found = drive(odom, lambda k: lidar.points(TRUTH[k]))
    assert "wheel_slip" in found.modes()[at : at + 2]
    assert not LOST & set(found.modes())
    assert off_m(found.poses(), TRUTH).max() < 0.03


@pytest.mark.slow
def test_a_lidar_that_pauses_for_two_seconds_is_survived() -> None:
    """Twenty scans are missing in the middle of a drive, again and again; odometry bridges them."""
    lidar, odom = Lidar(WALLS, 4), odometry(TRUTH, 4)
    kept = np.array([k for k in range(len(TRUTH)) if k % 100 < 80])
    found = drive(odom[kept], lambda k: lidar.points(TRUTH[kept[k]]))
    assert not LOST & set(found.modes())
    assert off_m(found.poses(), TRUTH[kept]).max() < 0.04


def kidnapped(there: Floats, seed: int) -> tuple[Drive, Floats, int]:
    """The tour, then the robot is carried to where ``there`` begins, and drives on; odometry notices nothing."""
    truth = np.vstack([TRUTH, there])
    before, after = odometry(TRUTH, seed), odometry(there, seed + 1)
    here = before[-1]
    cos, sin = math.cos(here[2]), math.sin(here[2])
    moved = after[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + here[:2]
    odom = np.vstack([before, np.column_stack([moved, after[:, 2] + here[2]])])
    lidar = Lidar(WALLS, seed)
    return drive(odom, lambda k: lidar.points(truth[k])), truth, len(TRUTH)


@pytest.mark.slow
def test_a_kidnapped_robot_says_that_it_is_lost_and_finds_back() -> None:
    """Carried into another room it soon says so, adds nothing to the map, and knows where it is some metres later."""
    there = poses_along([(9.2, 7.5), (9.25, 5.3), (9.2, 3.95), (6.0, 3.9)], heading_rad=-1.2)
    found, truth, at = kidnapped(there, 21)
    modes = found.modes()
    assert set(modes[:at]) == {"mapping"}
    assert min(k for k, mode in enumerate(modes) if mode in LOST) < at + 10
    assert modes[-1] == "mapping"
    known = np.array([k for k, mode in enumerate(modes) if mode == "mapping"])
    from_map = np.array([report.map_pose for report in found.reports])
    assert off_m(from_map[known], truth[known] if known[0] == 0 else truth)[-10:].max() < 0.05
    assert np.median(walls_off_m(found.state, truth, WALLS)) < 0.03
    assert np.percentile(walls_off_m(found.state, truth, WALLS), 99) < 0.12


@pytest.mark.slow
def test_a_map_is_gone_on_with_from_anywhere() -> None:
    """Restored, and the robot put down in another room: it is lost until it has seen enough, then maps on."""
    first = toured(31)
    state = start_new_part(restore_state(save_state(first.state)))
    there = poses_along([(1.2, 6.2), (3.3, 5.3), (3.35, 3.9), (6.5, 3.9)], heading_rad=0.9)
    lidar = Lidar(WALLS, 32)
    nodes = len(state.nodes)
    found = drive(odometry(there, 32), lambda k: lidar.points(there[k]), state)
    assert found.reports[0].mode in {SlamMode.LOST, SlamMode.SEARCHING}
    assert found.reports[-1].mode is SlamMode.MAPPING
    truth = np.vstack([TRUTH[:1], there])
    poses = np.vstack([np.zeros((1, 3)), found.poses()[:]])
    assert off_m(poses, truth)[-10:].max() < 0.05
    assert len(found.state.nodes) > nodes
    assert set(found.state.nodes.part.tolist()) == {0}


def look_alike_corridor() -> Floats:
    """A corridor of 22 m with five rooms of exactly the same shape along it, every 4.4 m, and nothing else."""
    rooms = []
    for k in range(5):
        x = 4.4 * k
        rooms += [
            wall((x, 0), (x, -4), (x + 4.4, -4), (x + 4.4, 0)),
            wall((x, 0), (x + 1.7, 0)),
            wall((x + 2.7, 0), (x + 4.4, 0)),
            box(x + 0.4, -3.7, 1.1, 0.5),
            box(x + 3.3, -2.6, 0.6, 0.9, 0.3),
        ]
    return np.vstack([wall((0, 0), (0, 2), (22, 2), (22, 0)), *rooms])


@pytest.mark.slow
def test_rooms_that_look_alike_are_not_taken_for_each_other() -> None:
    """Five equal rooms along a corridor: each visited room is its own, and the way back leads to the first one."""
    walls = look_alike_corridor()
    way = [(2.2, 1.0)]
    for k in (0, 1, 3, 4, 2, 0):
        x = 4.4 * k + 2.2
        way += [(x, 1.05), (x, -1.6), (x + 0.4, -2.2), (x, -1.0), (x, 0.95)]
    truth = poses_along(way)
    lidar = Lidar(walls, 2)
    found = drive(odometry(truth, 2), lambda k: lidar.points(truth[k]))
    assert sum(report.loops for report in found.reports) > 10
    assert off_m(found.poses(), truth).max() < 0.15
    assert np.median(walls_off_m(found.state, truth, walls)) < 0.05


def test_free_space_is_free_and_the_unseen_is_unknown(tour: Drive) -> None:
    """Where the robot drove is free, and beyond the outer walls nothing is known."""
    grid = occupancy(tour.state.nodes)
    rows, columns = np.nonzero(grid.percent >= 0)
    origin = np.array([grid.map_from_grid.x_m, grid.map_from_grid.y_m])
    known = transform(TRUTH[0], np.stack([columns + 0.5, rows + 0.5], axis=1) * grid.resolution_m + origin)
    outside = (known < -0.15).any(axis=1) | (known > [10.55, 8.25]).any(axis=1)
    assert outside.mean() < 0.001
    driven = tour.state.nodes.map[:, :2] - origin
    cells = (driven / grid.resolution_m).astype(int)
    assert (grid.percent[cells[:, 1], cells[:, 0]] < 20).all()


def test_what_a_corridor_leaves_open_is_left_open_in_the_graph() -> None:
    """In a bare corridor the robot turns left by a third of a right angle and backs off: along the walls it knows less.

    The edge is in the frame of its first node, which looks 0.5 rad off the corridor; there and in the report, in the
    map, the uncertain direction is that of the corridor.
    """
    walls = np.vstack([wall((-30, -1), (30, -1)), wall((30, 1), (-30, 1))])
    truth = np.array([(0.0, 0.0, 0.0), (0.2, 0, 0), (0.2, 0, 0.25), (0.2, 0, 0.5), (0.05, -0.08, 0.5)])
    lidar = Lidar(walls, 1)
    found = drive(odometry(truth, 1), lambda k: lidar.points(truth[k]), finish=False)
    edges = found.state.edges
    last = np.linalg.inv(edges.information[(edges.second == 4) & (edges.first == 3)][0])
    along, across = np.array([math.cos(0.5), -math.sin(0.5)]), np.array([math.sin(0.5), math.cos(0.5)])
    assert along @ last[:2, :2] @ along > 4 * (across @ last[:2, :2] @ across)
    covariance = found.reports[-1].covariance
    assert covariance[0, 0] > 20 * covariance[1, 1]


def test_a_slip_within_the_window_is_told_too() -> None:
    """A wheel spins and the odometry has 0.1 m too much in one step: matched away, and told."""
    lidar, odom, at = Lidar(WALLS, 6), odometry(TRUTH[:120], 6), 100
    odom[at:, :2] += 0.1 * np.array([math.cos(odom[at, 2]), math.sin(odom[at, 2])])
    found = drive(odom, lambda k: lidar.points(TRUTH[k]), finish=False)
    assert found.modes()[at] == "wheel_slip"
    assert found.modes().count("wheel_slip") == 1
    assert off_m(found.poses(), TRUTH[:120]).max() < 0.03


def test_an_odometry_that_jumps_by_kilometres_is_not_believed() -> None:
    """A counter that wrapped says a million metres: the scan says that the robot stands, and it goes on from there."""
    lidar, odom, at = Lidar(WALLS, 6), odometry(TRUTH[:120], 6), 60
    odom[at:, 0] += 1e6
    found = drive(odom, lambda k: lidar.points(TRUTH[k]), finish=False)
    assert found.modes()[at] == "wheel_slip"
    assert off_m(found.poses(), TRUTH[:120]).max() < 0.03
    assert max(max(active.grids.likelihood.shape) for active in found.state.active) < 1000


@pytest.mark.slow
def test_no_grid_grows_when_neither_scan_nor_odometry_can_be_believed() -> None:
    """It jumps while the robot is carried away: soon it is lost, and begins anew with a small map."""
    lidar, odom, at = Lidar(WALLS, 6), odometry(TRUTH[:120], 6), 60
    odom[at:, 0] += 1e6
    there = int(np.argmin(np.hypot(TRUTH[:, 0] - 8.5, TRUTH[:, 1] - 7.2)))
    truth = np.vstack([TRUTH[:at], TRUTH[there : there + 60]])
    found = drive(odom, lambda k: lidar.points(truth[k]), finish=False)
    assert LOST & set(found.modes()[at : at + 6])
    assert max(max(active.grids.likelihood.shape) for active in found.state.active) < 1000


def test_scans_of_nothing_are_survived() -> None:
    """A covered lidar sees nothing, at the beginning and on the way; odometry goes on."""
    lidar, odom = Lidar(WALLS, 6), odometry(TRUTH[:120], 6)
    nothing = np.zeros((0, 2), np.float32)
    blind = {0, 1, 50, 51, 52}
    found = drive(odom, lambda k: nothing if k in blind else lidar.points(TRUTH[k]))
    assert not LOST & set(found.modes())
    assert off_m(found.poses(), TRUTH[:120]).max() < 0.1


@pytest.mark.parametrize(
    ("odom", "points", "reason"),
    [
        (np.array([0.0, np.nan, 0.0]), np.zeros((1, 2), np.float32), "three finite numbers"),
        (np.zeros(3), np.full((1, 2), np.nan, np.float32), "within 100 m of the robot, got nan"),
        (np.zeros(3), np.full((1, 2), 101.0, np.float32), "within 100 m of the robot, got 101"),
        (np.zeros(3), np.zeros((1, 2)), "float32 arrays of one shape, got float64"),
    ],
)
def test_garbage_is_refused(odom: Floats, points: NDArray[np.float32], reason: str) -> None:
    """Before it reaches a grid; the message names the value."""
    scan = Scan(points, np.zeros_like(points), np.zeros(2))
    with pytest.raises(ValueError, match=reason):
        step(SlamParameters(), start(), 0.0, odom, scan)


@pytest.fixture(scope="module")
def put_elsewhere() -> SlamState:
    """Half a tour is mapped; then the robot may be anywhere."""
    return start_new_part(toured(33, scans=260, finish=False).state)


def searching_on(state: SlamState, lookups_a_step: int, scans: int, *, save_at: int = -1) -> Drive:
    """Some scans from where the tour went on, with so much of a search in each; at one of them all is restored."""
    params = SlamParameters(loops=LoopParameters(lookups_a_step=lookups_a_step))
    lidar, truth, reports = Lidar(WALLS, 34), TRUTH[20 : 20 + scans], []
    state = restore_state(save_state(state))
    for k, pose in enumerate(odometry(truth, 34)):
        if k == save_at:
            state = restore_state(save_state(state))
        state, report = step(params, state, 0.1 * k, pose, scan_of(lidar.points(truth[k])))
        reports.append(report)
    return Drive(state, reports)


def test_a_lost_robot_searches_a_bounded_part_in_each_step(put_elsewhere: SlamState) -> None:
    """The search goes on over many scans, says how far it is, and finds the same place as one that does all at once."""
    found = searching_on(put_elsewhere, 2_000_000, 110)
    searched = [report.searched for report in found.reports if report.mode is SlamMode.SEARCHING]
    assert len(searched) > 20
    assert min(searched) < 0.3
    assert max(searched) > 0.7
    assert found.reports[-1].mode is SlamMode.MAPPING
    at_once = searching_on(put_elsewhere, 10**12, 110)
    assert SlamMode.SEARCHING not in [report.mode for report in at_once.reports]
    assert found.reports[-1].map_pose == pytest.approx(at_once.reports[-1].map_pose, abs=0.05)


def test_a_search_that_was_saved_goes_on_as_if_nothing_had_happened(put_elsewhere: SlamState) -> None:
    """Saved in the middle of a submap, and restored, the same steps follow, bit for bit."""
    one, other = (searching_on(put_elsewhere, 2_000_000, 40, save_at=at) for at in (-1, 17))
    assert one.reports[16].mode is SlamMode.SEARCHING
    assert [report.searched for report in one.reports] == [report.searched for report in other.reports]
    assert np.array_equal(one.state.nodes.map, other.state.nodes.map)


def test_a_part_that_never_began_leaves_no_empty_submap() -> None:
    """The odometry began anew 20 m away, so that the first scans of a map that is gone on with do not fit."""
    state = start_new_part(toured(35, scans=60, finish=False).state)
    lidar, pose = Lidar(WALLS, 36), TRUTH[60]
    for k in range(8):
        state, _ = step(PARAMS, state, 0.1 * k, np.array([20.0, 0.0, 0.0]), scan_of(lidar.points(pose)))
    assert all(submap.first <= submap.last for submap in state.submaps)
