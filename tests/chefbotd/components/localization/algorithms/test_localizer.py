"""A robot that finds its way: in a flat of five rooms, with what goes wrong there."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from chefbotd.components.localization.algorithms.localizer import LocalizationReport
from chefbotd.components.localization.algorithms.searching import LocalizationMap, localization_map
from chefbotd.components.localization.algorithms.state import PoseEvent, PoseState, localize, set_pose
from chefbotd.core.poses import Floats, compose
from chefbotd.core.record import replace
from tests.budget import sample
from tests.chefbotd.components.localization.algorithms.buildings import (
    Robot,
    drawn,
    mirrored,
    off,
    twin_rooms,
)
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    box,
    furnished_flat,
    odometry,
    poses_along,
    to_walls_m,
    walking,
)

WALLS = furnished_flat()
TRUTH = poses_along(TOUR)
SURE_M, SURE_DEG = 0.2, 5.0


@pytest.fixture(scope="module")
def flat() -> LocalizationMap:
    """The flat, as its plan has it."""
    return localization_map(drawn(WALLS))


def placed(robot: Robot, pose: Floats) -> Robot:
    """The robot, knowing where it is: its odometry begins at zero there."""
    robot.now = set_pose(robot.now, pose, np.diag([0.01, 0.01, 0.01]))
    return robot


def somewhere(chance: np.random.Generator) -> Floats:
    """A pose in the flat, 0.3 m or more from what stands there."""
    while True:
        pose = np.array(
            [chance.uniform(0.3, 10.1), chance.uniform(0.3, 7.8), chance.uniform(-math.pi, math.pi)]
        )
        if to_walls_m(WALLS, pose[None, :2])[0] > 0.3:
            return pose


def places_of(report: LocalizationReport) -> list[tuple[float, float]]:
    """Where it might be, to a decimetre."""
    poses = [one.estimate.pose for one in report.alternatives]
    return sorted((round(float(pose[0]), 1), round(float(pose[1]), 1)) for pose in poses)


@pytest.mark.slow
def test_it_finds_itself_and_tracks_along_the_tour(flat: LocalizationMap) -> None:
    """Nobody says where it is. After half a second it knows, and stays within 0.02 m and 0.5 degrees in the median."""
    lidar, robot = Lidar(WALLS, 4), Robot(flat)
    way = TRUTH[:350]
    errors = [
        off(report, pose)
        for report, pose in zip(
            robot.drive(odometry(way, 4), lambda k: lidar.points(way[k])), way, strict=True
        )
    ]
    states = [report.state for report in robot.reports]
    assert states[:4] == [PoseState.SEARCHING] * 4
    assert set(states[6:]) == {PoseState.LOCALIZED}
    metres, degrees = np.array(errors[6:]).T
    assert np.median(metres) < 0.02
    assert np.percentile(metres, 95) < 0.05
    assert np.median(degrees) < 0.5
    assert np.percentile(degrees, 95) < 1.5
    assert all(report.fit > 0.9 for report in robot.reports[6:])


def test_its_covariance_holds_what_it_promises(flat: LocalizationMap) -> None:
    """Errors, squared and weighed by the covariance, have a mean near 3, as the sum of three squares should have.

    The map's cells are 5 cm and its errors last, so the bounds are wide.
    """
    lidar, robot, squares = Lidar(WALLS, 7), Robot(flat), []
    way = TRUTH[100:300]
    for report, pose in zip(robot.drive(odometry(way, 7), lambda k: lidar.points(way[k])), way, strict=True):
        if report.map_from_base is not None:
            error = report.map_from_base.pose - pose
            error[2] = math.remainder(error[2], math.tau)
            squares.append(error @ np.linalg.solve(report.map_from_base.covariance, error))
    assert 0.3 < np.mean(squares) < 6


@pytest.mark.parametrize("seed", sample(range(8), fast=2))
def test_it_finds_itself_from_any_start(flat: LocalizationMap, seed: int) -> None:
    """Standing anywhere and turning slowly, it is right within 3 s, and never sure of a wrong place."""
    chance, lidar, robot = np.random.default_rng(seed), Lidar(WALLS, seed), Robot(flat)
    start = somewhere(chance)
    for k in range(30):
        turned = np.array([0.0, 0.0, 0.06 * k])
        report = robot.take(turned, lidar.points(compose(start, turned)))
        if report.state is PoseState.LOCALIZED:
            metres, degrees = off(report, compose(start, turned))
            assert metres < SURE_M
            assert degrees < SURE_DEG
    assert report.state is PoseState.LOCALIZED


@pytest.mark.parametrize("seed", sample(range(4)))
def test_a_kidnapping_is_noticed_and_undone(flat: LocalizationMap, seed: int) -> None:
    """Put into another place, and odometry knows nothing of it: noticed within 3 s, and right again within 10 s."""
    chance, lidar = np.random.default_rng(50 + seed), Lidar(WALLS, seed)
    before, after = somewhere(chance), somewhere(chance)
    while math.dist(before[:2], after[:2]) < 1.5:
        after = somewhere(chance)
    robot, still = placed(Robot(flat), before), np.zeros(3)
    assert robot.look(still, lambda: lidar.points(before), 10).state is PoseState.LOCALIZED
    assert (
        robot.look(still, lambda: lidar.points(after), 30).state is not PoseState.LOCALIZED
        or off(robot.reports[-1], after)[0] < SURE_M
    )
    events = [report.event for report in robot.reports if report.event]
    assert events[:4] == [PoseEvent.FITS, PoseEvent.MISFITS, PoseEvent.GIVEN_UP, PoseEvent.SEARCH_STARTED]
    report = robot.look(still, lambda: lidar.points(after), 70)
    assert report.state is PoseState.LOCALIZED
    assert off(report, after)[0] < 0.05


@pytest.mark.slow
def test_people_and_a_moved_chair_do_no_harm(flat: LocalizationMap) -> None:
    """Three people walk about and a box stands where the map has none: it stays localized, within 0.05 m."""
    changed = np.vstack([WALLS, box(2.2, 3.6, 0.5, 0.3, 0.5), box(7.4, 1.5, 0.45, 0.45, 0.2)])
    lidar, way = Lidar(changed, 3), TRUTH[:400]
    paths = (((0.6, 4.3), (9.8, 4.3)), ((1.0, 2.5), (4.0, 1.6)), ((5.0, 5.2), (7.0, 6.8)))
    people: Iterator[Floats] = walking(len(way), *paths)
    robot = placed(Robot(flat), way[0])
    worst = 0.0
    for report, pose in zip(
        robot.drive(odometry(way, 3), lambda k: lidar.points(way[k], next(people))), way, strict=True
    ):
        if report.state is PoseState.LOCALIZED:
            worst = max(worst, off(report, pose)[0])
    lost = [k for k, report in enumerate(robot.reports) if k > 3 and report.state is not PoseState.LOCALIZED]
    assert not lost
    assert worst < 0.06


@pytest.mark.slow
def test_glass_does_no_harm(flat: LocalizationMap) -> None:
    """The long wall at y = 3.2 turns out to be glass, and beams go through it. The fit falls, the pose holds.

    Where the robot drives along it, half of all beams contradict the map: that is uncertain for a moment, never lost.
    """
    glass = (WALLS[:, 1] == 3.2) & (WALLS[:, 3] == 3.2) & (WALLS[:, 0] > 2.4) & (WALLS[:, 2] < 6.4)
    assert glass.sum() == 1
    lidar, way = Lidar(WALLS[~glass], 5), TRUTH[20:260]
    robot = placed(Robot(flat), way[0])
    errors = [
        off(report, pose)[0]
        for report, pose in zip(
            robot.drive(odometry(way, 5), lambda k: lidar.points(way[k])), way, strict=True
        )
    ]
    assert {report.state for report in robot.reports[3:]} <= {PoseState.LOCALIZED, PoseState.UNCERTAIN}
    assert sum(report.state is PoseState.UNCERTAIN for report in robot.reports[3:]) < 20
    assert min(report.fit for report in robot.reports[3:]) < 0.9
    assert max(errors) < 0.06


def test_a_lidar_that_pauses_is_bridged(flat: LocalizationMap) -> None:
    """For 2 s there is only odometry, which is 4 percent off: the covariance grows, and the next scan puts it right."""
    lidar, way = Lidar(WALLS, 6), TRUTH[:200]
    robot = placed(Robot(flat), way[0])
    off_m = []
    pause = range(100, 120)
    for report, pose in zip(
        robot.drive(odometry(way, 6), lambda k: None if k in pause else lidar.points(way[k])),
        way,
        strict=True,
    ):
        off_m.append(off(report, pose)[0])
    assert robot.reports[-1].state is PoseState.LOCALIZED
    spread = [
        math.sqrt(report.map_from_base.covariance[0, 0]) for report in robot.reports if report.map_from_base
    ]
    assert spread[119] > 3 * spread[99]
    assert max(off_m[121:]) < 0.04


def test_wheels_that_slip_are_seen_through(flat: LocalizationMap) -> None:
    """On a carpet the wheels turn for 0.6 m while the robot stands: it does not believe them for longer than 1 s."""
    lidar, way = Lidar(WALLS, 8), TRUTH[60:110]
    told = odometry(way, 8)
    robot = placed(Robot(flat), way[0])
    for pose, seen in zip(told, way, strict=True):
        robot.take(pose, lidar.points(seen))
    spun = told[-1].copy()
    for _ in range(6):
        spun = compose(spun, np.array([0.1, 0.0, 0.0]))
        robot.take(spun, lidar.points(way[-1]))
    report = robot.look(spun, lambda: lidar.points(way[-1]), 10)
    assert report.state is PoseState.LOCALIZED
    assert off(report, way[-1])[0] < 0.04


def test_scans_and_odometry_may_be_apart_by_a_tenth_of_a_second(flat: LocalizationMap) -> None:
    """Each scan comes with the odometry of the one before: it stays localized, within 0.05 m and 1.5 degrees."""
    lidar, way = Lidar(WALLS, 9), TRUTH[:300]
    late = odometry(way, 9)[np.maximum(np.arange(300) - 1, 0)]
    robot = placed(Robot(flat), way[0])
    errors = [
        off(report, pose)
        for report, pose in zip(robot.drive(late, lambda k: lidar.points(way[k])), way, strict=True)
    ]
    assert {report.state for report in robot.reports[3:]} == {PoseState.LOCALIZED}
    metres, degrees = np.array(errors[3:]).T
    assert np.percentile(metres, 95) < 0.05
    assert np.percentile(degrees, 95) < 1.5


@pytest.mark.slow
def test_a_mirrored_map_is_never_believed() -> None:
    """The map's image is flipped. Rooms are rectangles, so some of it fits; it is not sure anywhere on the way."""
    lidar, way = Lidar(WALLS, 1), TRUTH[:160]
    robot = Robot(localization_map(mirrored(drawn(WALLS))))
    for _ in robot.drive(odometry(way, 1), lambda k: lidar.points(way[k])):
        pass
    assert PoseState.LOCALIZED not in {report.state for report in robot.reports}
    assert PoseEvent.NOT_FOUND in {report.event for report in robot.reports}


def test_twin_rooms_are_both_named_until_motion_tells_them_apart() -> None:
    """In one of two equal rooms it names both and is sure of neither; once through the door it is sure, and right."""
    walls = twin_rooms()
    lidar, robot = Lidar(walls, 2), Robot(localization_map(drawn(walls)))
    start = np.array([6.6, 1.9, 2.0])
    turns = [compose(start, np.array([0.0, 0.0, 0.05 * k])) for k in range(40)]
    way = np.vstack(
        [turns, poses_along([(6.6, 1.9), (5.2, 2.4), (5.25, 3.8), (7.5, 3.9)], float(turns[-1][2]))[1:]]
    )
    told = odometry(way, 2)
    for k in range(40):
        report = robot.take(told[k], lidar.points(way[k]))
    assert report.state is PoseState.SEARCHING
    assert places_of(report) == [(2.6, 1.9), (6.6, 1.9)]
    for k in range(40, len(way)):
        report = robot.take(told[k], lidar.points(way[k]))
        if report.state is PoseState.LOCALIZED:
            assert off(report, way[k])[0] < SURE_M
    assert report.state is PoseState.LOCALIZED


def test_a_symmetric_corridor_is_two_places() -> None:
    """A corridor with a cupboard at each end, on opposite sides, is the same when turned round: it says both."""
    walls = np.vstack([box(0, 0, 8, 1.6), box(1.0, 0.0, 0.7, 0.3), box(6.3, 1.3, 0.7, 0.3)])
    lidar, robot = Lidar(walls, 3), Robot(localization_map(drawn(walls)))
    pose = np.array([2.9, 0.7, 0.4])
    report = robot.look(np.zeros(3), lambda: lidar.points(pose), 40)
    assert report.state is PoseState.SEARCHING
    assert places_of(report) == [(2.9, 0.7), (5.1, 0.9)]
    turns = [math.remainder(one.estimate.pose[2] - 0.4, math.tau) for one in report.alternatives]
    assert sorted(abs(turn) for turn in turns) == pytest.approx([0, math.pi], abs=0.05)


def test_along_a_bare_corridor_the_covariance_is_long() -> None:
    """With both ends out of sight only odometry tells the way along it: the covariance is long there, short across."""
    walls = np.array([[-40.0, 0, 40, 0], [-40, 1.8, 40, 1.8]])
    lidar, robot = (
        Lidar(walls, 3),
        placed(Robot(localization_map(drawn(walls))), np.array([-9.0, 0.8, 0.0])),
    )
    way = poses_along([(-9.0, 0.8), (0.0, 0.8)], 0.0)
    for _ in robot.drive(odometry(way, 3, turn_scale=1.0), lambda k: lidar.points(way[k])):
        pass
    covariance = robot.reports[-1].map_from_base.covariance
    assert math.sqrt(covariance[0, 0]) > 0.25
    assert math.sqrt(covariance[1, 1]) < 0.03
    assert abs(off(robot.reports[-1], way[-1])[0]) < 3 * math.sqrt(covariance[0, 0])


def test_a_given_pose_is_uncertain_until_scans_confirm_it(flat: LocalizationMap) -> None:
    """A person is 0.4 m and 15 degrees off: three scans put it right. In the wrong room it is given up, and searched."""
    lidar, pose, still = Lidar(WALLS, 2), np.array([2.0, 2.4, 0.3]), np.zeros(3)
    robot = Robot(flat)
    robot.now = set_pose(robot.now, pose + np.array([0.3, -0.27, math.radians(15)]))
    assert robot.now.state is PoseState.UNCERTAIN
    report = robot.look(still, lambda: lidar.points(pose), 3)
    assert report.state is PoseState.LOCALIZED
    assert off(report, pose)[0] < 0.05
    robot.now = set_pose(robot.now, np.array([8.5, 6.0, 0.3]))
    report = robot.look(still, lambda: lidar.points(pose), 40)
    assert PoseEvent.GIVEN_UP in [report.event for report in robot.reports]
    assert report.state is PoseState.LOCALIZED
    assert off(report, pose)[0] < 0.05


def test_a_given_pose_from_which_nothing_of_the_map_is_seen_is_given_up(flat: LocalizationMap) -> None:
    """100 m beside the flat no scan says that it is wrong: it is uncertain for 10 s, and not for ever."""
    lidar, pose = Lidar(WALLS, 2), np.array([2.0, 2.4, 0.3])
    robot = Robot(flat)
    robot.now = set_pose(robot.now, np.array([100.0, 100.0, 0.3]))
    report = robot.look(np.zeros(3), lambda: lidar.points(pose), 95)
    assert report.state is PoseState.UNCERTAIN
    report = robot.look(np.zeros(3), lambda: lidar.points(pose), 40)
    assert report.state is PoseState.LOCALIZED
    assert off(report, pose)[0] < 0.05


def test_no_search_where_it_is_not_wanted(flat: LocalizationMap) -> None:
    """With searching by itself switched off it says that it is unknown, until ``localize`` is asked for."""
    lidar, pose, still = Lidar(WALLS, 2), np.array([2.0, 2.4, 0.3]), np.zeros(3)
    robot = Robot(flat, auto_search=False)
    assert robot.look(still, lambda: lidar.points(pose), 20).state is PoseState.UNKNOWN
    robot.now = localize(robot.now)
    assert robot.look(still, lambda: lidar.points(pose), 20).state is PoseState.LOCALIZED


def test_a_pose_that_is_none_is_refused(flat: LocalizationMap) -> None:
    """Three finite numbers, and the message has the value."""
    with pytest.raises(ValueError, match=r"got \[1.0, nan, 0.0\]"):
        set_pose(Robot(flat).now, np.array([1.0, math.nan, 0.0]))


def test_what_others_are_told_never_jumps_in_silence(flat: LocalizationMap) -> None:
    """From scan to scan the correction changes by what the rates allow, unless the report says that it jumped."""
    lidar, way = Lidar(WALLS, 4), TRUTH[:200]
    told = odometry(way, 4)
    robot = Robot(flat)
    last = None
    for k, report in enumerate(robot.drive(told, lambda k: lidar.points(way[k]))):
        if report.map_from_odom is None:
            continue
        if last is not None and not report.jumped:
            a, b = compose(last, told[k]), compose(report.map_from_odom, told[k])
            assert math.dist(a[:2], b[:2]) <= 0.2 * 0.1 + 1e-9
            assert abs(math.remainder(a[2] - b[2], math.tau)) <= 0.35 * 0.1 + 1e-9
        last = report.map_from_odom
    assert sum(report.jumped for report in robot.reports) == 1
    assert off(robot.reports[-1], way[-1])[0] < 0.03


def test_the_same_input_gives_the_same_bits(flat: LocalizationMap) -> None:
    """Nothing is left to chance."""
    runs, way = [], TRUTH[:60]
    for _ in range(2):
        lidar, robot = Lidar(WALLS, 4), Robot(flat)
        for told, pose in zip(odometry(way, 4), way, strict=True):
            robot.take(told, lidar.points(pose))
        runs.append(robot.reports[-1].map_from_base)
    assert (runs[0].pose == runs[1].pose).all()
    assert (runs[0].covariance == runs[1].covariance).all()


@pytest.mark.parametrize("seed", sample(range(8), fast=3))
def test_a_wrong_pose_that_was_given_is_not_believed(flat: LocalizationMap, seed: int) -> None:
    """2.5 m along a wall, or turned round: while the robot stands for 4 s it is never localized at a wrong place."""
    chance, lidar = np.random.default_rng(seed), Lidar(WALLS, seed)
    truth = somewhere(chance)
    motion = np.array([0.0, 0.0, math.pi] if seed % 2 else [2.5, 0.0, 0.0])
    robot, still = placed(Robot(flat), compose(truth, motion)), np.zeros(3)
    for _ in range(40):
        report = robot.take(still, lidar.points(truth))
        if report.state is PoseState.LOCALIZED:
            assert off(report, truth)[0] < 0.3


def test_a_pose_that_was_given_in_a_bare_tunnel_stays_uncertain() -> None:
    """Nothing tells where along it the robot is, so a lie of 2.5 m along it is not confirmed."""
    walls = np.array([[-40.0, 0, 40, 0], [-40, 1.8, 40, 1.8]])
    within = localization_map(drawn(walls))
    lidar, robot = Lidar(walls, 3), placed(Robot(within), np.array([-6.5, 0.8, 0.0]))
    for _ in range(20):
        robot.take(np.zeros(3), lidar.points(np.array([-9.0, 0.8, 0.0])))
    assert PoseState.LOCALIZED not in {report.state for report in robot.reports}


@pytest.mark.parametrize("seed", sample((4, 13, 29, 45, 57, 61, 0, 1, 2, 3), fast=3))
def test_a_pose_that_was_believed_is_doubted_by_what_contradicts_it(flat: LocalizationMap, seed: int) -> None:
    """It stands elsewhere than it believed a moment ago: not localized for longer than a second."""
    chance, lidar = np.random.default_rng(seed), Lidar(WALLS, seed)
    truth = TRUTH[chance.integers(len(TRUTH))]
    lies = (
        compose(truth, np.array([0.0, 0.0, math.pi])),
        truth + np.array([chance.choice([-2.5, 2.5]), 0.0, 0.0]),
        truth + np.array([0.0, chance.choice([-2.5, 2.5]), 0.0]),
        TRUTH[chance.integers(len(TRUTH))],
    )
    robot = placed(Robot(flat), lies[seed % 4])
    robot.now = replace(robot.now, state=PoseState.LOCALIZED, is_unchecked=False, checked=(np.zeros(3), 0.95))
    for _ in range(40):
        robot.take(np.zeros(3), lidar.points(truth))
    wrong = [
        report
        for report in robot.reports
        if report.state is PoseState.LOCALIZED and off(report, truth)[0] > 0.3
    ]
    assert len(wrong) <= 10


@pytest.mark.slow
def test_people_and_moved_furniture_are_no_reason_to_give_up_a_pose(flat: LocalizationMap) -> None:
    """All furniture is up to 0.7 m from its place, or eight people stand around: it stays right, mostly sure."""
    chance, furniture = np.random.default_rng(0), WALLS.copy()
    for k in range(len(WALLS) - 32, len(WALLS), 4):
        furniture[k : k + 4] += np.tile(chance.uniform(-0.5, 0.5, 2), 2)
    for walls, count in ((furniture, 0), (WALLS, 8)):
        lidar, robot, told = Lidar(walls, 3), placed(Robot(flat), TRUTH[0]), odometry(TRUTH, 3)
        for k, pose in enumerate(TRUTH):
            near = np.random.default_rng(k // 5)
            bearing, away_m = near.uniform(0, math.tau, count), near.uniform(0.6, 1.6, count)
            x, y = pose[0] + away_m * np.cos(bearing), pose[1] + away_m * np.sin(bearing)
            report = robot.take(told[k], lidar.points(pose, np.stack([x, y, np.full(count, 0.2)], axis=1)))
            assert off(report, pose)[0] < 0.3
        states = [report.state for report in robot.reports]
        assert states.count(PoseState.LOCALIZED) > 0.9 * len(states)
