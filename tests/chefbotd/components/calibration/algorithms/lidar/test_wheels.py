"""The step ``wheels`` on a robot in a room whose wheels scatter, and on what a real robot can be wrong in."""

import math
import random

import numpy as np
import pytest

from benchmarks import estimation, slipping
from chefbotd.components.calibration.algorithms.lidar import LIDAR
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Measurements,
    Move,
    Procedure,
    Status,
    StepResult,
)
from chefbotd.components.calibration.algorithms.wheel_model import WheelModel
from chefbotd.components.calibration.algorithms.wheels import WHEELS
from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import replace
from chefbotd.motion.odometry import FusionParameters
from tests.chefbotd.components.calibration.algorithms.synthetic import Truth, World, configured

MODEL = WheelModel(left=0.993, right=1.006, track=1.025)
MOUNT = (0.012, -0.008, 0.03)


@pytest.fixture(scope="module")
def robot() -> ConfiguredRobot:
    """ChefBot with a lidar in the middle."""
    return configured()


@pytest.fixture(scope="module")
def drive(robot: ConfiguredRobot) -> Measurements:
    """All that is measured while a robot that is wrong carries out the procedure."""
    return World(robot, Truth(MODEL, MOUNT), seed=3).perform(WHEELS.procedure(robot))


@pytest.fixture(scope="module")
def result(robot: ConfiguredRobot, drive: Measurements) -> StepResult:
    """What is fitted to it."""
    return WHEELS.fit(robot, drive)


def _after(result: StepResult) -> dict[str, float]:
    return {estimate.key.rpartition(".")[2]: estimate.after for estimate in result.estimates}


def test_wheels_and_mount_are_recovered(robot: ConfiguredRobot, result: StepResult) -> None:
    """Ratio to 0.15 %, track and size to 0.2 %, the mount to 1 mm and 0.1 deg, all within 4 standard deviations."""
    assert result.status is Status.PASSED, result.reason
    after, lidar = _after(result), robot.lidars[0]
    ratio = after["left_radius_multiplier"] / after["right_radius_multiplier"]
    assert ratio == pytest.approx(MODEL.left / MODEL.right, rel=1.5e-3)
    assert after["track_multiplier"] == pytest.approx(MODEL.track, rel=2e-3)
    assert after["left_radius_multiplier"] == pytest.approx(MODEL.left, rel=2e-3)
    assert (after["mount_x_m"], after["mount_y_m"]) == pytest.approx(MOUNT[:2], abs=1e-3)
    assert after["mount_yaw_rad"] == pytest.approx(MOUNT[2], abs=math.radians(0.1))
    truth = (MODEL.left, MODEL.right, MODEL.track, *MOUNT)
    off = [(one.after - true) / one.sigma for one, true in zip(result.estimates, truth, strict=False)]
    assert max(map(abs, off)) < 4
    assert lidar.name in result.estimates[3].key
    assert all(residual.after < residual.before for residual in result.residuals)


def test_what_is_left_uncertain_is_what_odometry_takes_into_account(result: StepResult) -> None:
    """Ten robots that are off by what the result says: their NEES is within bounds, and nearer to 3 than by defaults."""
    left = {
        estimate.key.removeprefix("odometry.fusion."): estimate.after
        for estimate in result.estimates
        if estimate.key.startswith("odometry.fusion.")
    }
    assert left.keys() == {"size_sigma", "ratio_sigma", "track_sigma"}
    calibrated = slipping.CALIBRATED.model_copy(update=left)
    defaults = {key: getattr(FusionParameters(), key) for key in left}
    (low, high), nees = estimation.BOUNDS[10], _nees(calibrated, calibrated)
    assert low < nees < high
    by_defaults = _nees(calibrated, slipping.CALIBRATED.model_copy(update=defaults))
    assert abs(nees - 3) < abs(by_defaults - 3)


def _nees(true: FusionParameters, stated: FusionParameters) -> float:
    """The mean of 10 drives of 60 s by wheels and headings; the robots are drawn from what is true."""
    values = []
    for seed in range(10):
        chance, odometry = random.Random(seed), slipping.fused(stated)
        for moment in slipping.drive(slipping.drawn(true, chance), 60.0, chance, raw_imu=False):
            slipping.feed(odometry, moment)
        values.append(estimation._nees(odometry.estimate, moment))
    return sum(values) / len(values)


@pytest.mark.parametrize("offset_m", [-0.009, pytest.param(0.009, marks=pytest.mark.slow)])
def test_a_lidar_that_reads_too_far_leaves_the_sizes_as_they_are(
    robot: ConfiguredRobot, drive: Measurements, result: StepResult, offset_m: float
) -> None:
    """9 mm on every beam move track and size by less than 0.1 % from what they are without, and it is said."""
    scans = tuple(
        replace(
            one,
            scan=replace(one.scan, range_m=np.where(one.scan.range_m > 0, one.scan.range_m + offset_m, 0)),
        )
        for one in drive.scans
    )
    moved = WHEELS.fit(robot, replace(drive, scans=scans))
    after, without = _after(moved), _after(result)
    for key in ("left_radius_multiplier", "right_radius_multiplier", "track_multiplier"):
        assert after[key] == pytest.approx(without[key], rel=1e-3)
    assert f"mm too {'far' if offset_m > 0 else 'near'}, which is taken into account" in moved.reason


def test_the_same_measurements_give_the_same_result(
    robot: ConfiguredRobot, drive: Measurements, result: StepResult
) -> None:
    """To the last bit: a recorded drive can be calibrated from afterwards."""
    assert WHEELS.fit(robot, drive) == result


def test_the_procedure_stays_near_its_start(robot: ConfiguredRobot) -> None:
    """Where there is much space, the middle of the axle stays within 0.7 m, and it takes at most 200 s."""
    world = World(robot, Truth(slip=0.0))
    world.perform(WHEELS.procedure(robot))
    trail = np.array(world.trail)
    assert np.hypot(*(trail[:, 1:3] - trail[0, 1:3]).T).max() < 0.7
    assert world.now_s - trail[0, 0] < 200


@pytest.mark.parametrize(
    ("truth", "reason"),
    [
        (Truth(swapped=True), "the left and the right encoder are swapped"),
        (Truth(signs=(-1, 1)), "the left encoder counts backwards"),
        (Truth(signs=(1, -1)), "the right encoder counts backwards"),
        (Truth(signs=(-1, -1)), "both encoders count backwards"),
        (Truth(WheelModel(left=0.5, right=0.5)), "times as much as its radius and the track say"),
    ],
)
def test_wrong_wiring_is_refused_and_named(robot: ConfiguredRobot, truth: Truth, reason: str) -> None:
    """The first small motions show it; no negative radius is ever a result."""
    result = WHEELS.fit(robot, World(robot, truth).perform(WHEELS.procedure(robot), most=13))
    assert (result.status, result.estimates) == (Status.REFUSED, ())
    assert reason in result.reason


def _without_stops(motions: list[tuple[float, float, float]]) -> Procedure:
    for linear_m_s, angular_rad_s, seconds in motions:
        yield Move(Twist2D(linear_m_s, angular_rad_s), seconds, "", settled=False)


def _look_after(*motions: tuple[Twist2D, float]) -> Procedure:
    for twist, seconds in motions:
        yield Move(None, 0.6, "")
        yield Move(twist, seconds, "")
    yield Move(None, 0.6, "")


def test_straights_alone_are_not_enough(robot: ConfiguredRobot) -> None:
    """To and fro says nothing of the track."""
    straights = [(Twist2D(sign * 0.3), 1.5) for sign in (1, -1) * 4]
    result = WHEELS.fit(robot, World(robot, Truth()).perform(_look_after(*straights)))
    assert result.status is Status.NOT_ENOUGH
    assert "turns" in result.reason


def test_turns_alone_are_not_enough(robot: ConfiguredRobot) -> None:
    """On the spot says nothing of the radii."""
    turns = [(Twist2D(0.0, sign * 1.0), 2.0) for sign in (1, -1) * 4]
    result = WHEELS.fit(robot, World(robot, Truth()).perform(_look_after(*turns)))
    assert result.status is Status.NOT_ENOUGH
    assert "travel" in result.reason


@pytest.mark.slow
def test_scans_that_are_noise_are_no_result(robot: ConfiguredRobot, drive: Measurements) -> None:
    """Ranges drawn at random are refused, or said to be too little."""
    random = np.random.default_rng(0)
    scans = tuple(
        replace(one, scan=replace(one.scan, range_m=random.uniform(0.3, 8.0, len(one.scan.range_m))))
        for one in drive.scans
    )
    result = WHEELS.fit(robot, replace(drive, scans=scans))
    assert (result.status is Status.PASSED, result.estimates) == (False, ())


@pytest.mark.parametrize("kind", ["wheels", "scans", "both"])
def test_what_was_not_measured_is_named(robot: ConfiguredRobot, drive: Measurements, kind: str) -> None:
    """Without readings or scans there is no result, and no exception."""
    wheels = () if kind != "scans" else drive.wheels
    scans = () if kind != "wheels" else drive.scans
    result = WHEELS.fit(robot, Measurements(wheels=wheels, scans=scans))
    assert result.status is Status.NOT_ENOUGH
    assert ("readings of the wheels" if kind != "scans" else "no scans") in result.reason


@pytest.mark.slow
def test_a_recorded_drive_without_stops_is_enough(robot: ConfiguredRobot) -> None:
    """Curves through the room, scans corrected by the wheels: ratio, track and size to 0.6 %, and an honest sigma."""
    world = World(robot, Truth(MODEL, MOUNT), seed=5)
    curves = [
        (0.2, 0.9, 8.0),
        (0.2, -0.9, 8.0),
        (-0.2, 0.9, 8.0),
        (-0.2, -0.9, 8.0),
        (0.25, 0.0, 1.6),
        (-0.25, 0, 1.6),
    ]
    result = WHEELS.fit(robot, world.perform(_without_stops(curves * 2)))
    assert result.status is Status.PASSED, result.reason
    truth = (MODEL.left, MODEL.right, MODEL.track)
    for estimate, true in zip(result.estimates, truth, strict=False):
        assert estimate.after == pytest.approx(true, rel=6e-3)
        assert abs(estimate.after - true) < 4 * estimate.sigma


def test_truth_serves_where_there_is_no_lidar(robot: ConfiguredRobot) -> None:
    """A simulator's truth beside the wheels gives radii and track."""
    world = World(replace(robot), Truth(MODEL), seed=2)
    drive = world.perform(WHEELS.procedure(robot))
    truth = tuple(
        TruthSimulated(at_s, Pose2D(x, y, heading), STANDING, False) for at_s, x, y, heading in world.trail
    )
    result = WHEELS.fit(robot, Measurements(wheels=drive.wheels, truth=truth))
    assert result.status is Status.PASSED, result.reason
    assert _after(result)["track_multiplier"] == pytest.approx(MODEL.track, rel=3e-3)


def test_the_mount_alone_is_recovered_where_the_wheels_are_right(robot: ConfiguredRobot) -> None:
    """Half of the motions give x and y to 2 mm and the yaw to 0.1 deg, within four standard deviations."""
    drive = World(robot, Truth(mount=MOUNT), seed=4).perform(LIDAR.procedure(robot))
    result = LIDAR.fit(robot, drive)
    assert result.status is Status.PASSED, result.reason
    assert list(_after(result)) == ["mount_x_m", "mount_y_m", "mount_yaw_rad"]
    limits = (2e-3, 2e-3, math.radians(0.1))
    for estimate, true, limit in zip(result.estimates, MOUNT, limits, strict=True):
        assert estimate.after == pytest.approx(true, abs=limit)
        assert abs(estimate.after - true) < 4 * estimate.sigma


def test_a_mount_without_scans_is_not_enough(robot: ConfiguredRobot, drive: Measurements) -> None:
    """A second lidar that was silent is named."""
    second = robot.lidars[0].model_copy(update={"name": "rear"})
    result = LIDAR.fit(replace(robot, lidars=(second,)), drive)
    assert (result.status, result.estimates) == (Status.NOT_ENOUGH, ())
    assert "rear saw too little" in result.reason
