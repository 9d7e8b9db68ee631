"""Checks that need a person at the robot: push it, turn it, place a box before it, lift its front.

With ``--motors`` the robot drives itself instead, where yes is typed.
"""

import math
from collections.abc import Mapping

from chefbotd.client import CallError, Client
from chefbotd.components.doctor.algorithms.finding import Finding, skip_check
from chefbotd.components.doctor.algorithms.lidar import ScanTaken, check_ahead, check_motion
from chefbotd.components.doctor.algorithms.sensors import (
    AHEAD_M,
    check_beam_ahead,
    check_imu_lift,
    check_imu_turn,
)
from chefbotd.components.doctor.algorithms.wheels import check_distance, check_push, check_turn
from chefbotd.components.doctor.cli.collecting import Snapshot, snapshot
from chefbotd.components.doctor.cli.diagnosis import YES, Diagnosis
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.motion.kinematics import Kinematics

SKIP = "skip"
FORWARD_M, FORWARD_M_S = 0.3, 0.1
TURN_RAD, TURN_RAD_S = math.pi / 2, 0.5
AHEAD_WITHIN_RAD = math.radians(30)
LEAVE_OUT = "Type skip to leave it out."
SOMEBODY = "run the doctor with somebody beside the robot"


async def examine_with_help(diagnosis: Diagnosis, robot: Client) -> None:
    """All four, each with a question of its own."""
    await _push(diagnosis, robot)
    await _turn(diagnosis, robot)
    await _place_ahead(diagnosis, robot)
    await _lift(diagnosis, robot)


async def _has_moved(
    diagnosis: Diagnosis, robot: Client, what: str, by_itself: str, twist: tuple[float, float, float]
) -> bool:
    """Whether somebody moved the robot, or had it drive: ``twist`` is for how long, forward and to the left."""
    offer = f" Or clear the way, and type yes: it then {by_itself}." if diagnosis.motors else ""
    answer = await diagnosis.asker.ask(f"{what}, and press Enter.{offer} {LEAVE_OUT}")
    if answer is None or answer.lower() == SKIP:
        return False
    if answer == YES and diagnosis.motors:
        try:
            await robot.drive_for(*twist)
        except CallError as error:
            diagnosis.find(
                skip_check(
                    "drive",
                    f"the robot refused to drive: {error.message}",
                    "mend what it names, and ask the doctor again",
                )
            )
            return False
    return True


async def _push(diagnosis: Diagnosis, robot: Client) -> None:
    before = await snapshot(robot)
    what = "Push the robot straight ahead on the floor by about 30 cm"
    by_itself = f"drives {FORWARD_M:g} m ahead at {FORWARD_M_S:g} m/s"
    if not await _has_moved(diagnosis, robot, what, by_itself, (FORWARD_M / FORWARD_M_S, FORWARD_M_S, 0.0)):
        diagnosis.find(skip_check("encoders", "the robot was not pushed", SOMEBODY))
        return
    after = await snapshot(robot)
    diagnosis.find(*check_push(diagnosis.wheels, _turns_between(before, after)))
    motion = _motion(diagnosis, before, after)
    diagnosis.find(*_lidar_motion(before, after, motion))
    answer = await diagnosis.asker.ask(
        "How far did it go, in centimetres? Press Enter if you did not measure."
    )
    real_m = _number(answer) / 100
    diagnosis.find(check_distance(motion.x_m, real_m, diagnosis.settings.encoders.counts_per_turn))


async def _turn(diagnosis: Diagnosis, robot: Client) -> None:
    before = await snapshot(robot)
    what = (
        "Turn the robot on the spot to the left (counter-clockwise, seen from above) by about a quarter turn"
    )
    by_itself = f"turns by itself at {TURN_RAD_S:g} rad/s"
    if not await _has_moved(diagnosis, robot, what, by_itself, (TURN_RAD / TURN_RAD_S, 0.0, TURN_RAD_S)):
        diagnosis.find(skip_check("turn", "the robot was not turned", SOMEBODY))
        return
    after = await snapshot(robot)
    motion = _motion(diagnosis, before, after)
    diagnosis.find(check_turn(motion.heading_rad, diagnosis.wheels, _turns_between(before, after)))
    if diagnosis.settings.imu is not None:
        diagnosis.find(check_imu_turn(_imu_turned(before, after), motion.heading_rad))
    diagnosis.find(*_lidar_motion(before, after, motion))


async def _place_ahead(diagnosis: Diagnosis, robot: Client) -> None:
    mounts = diagnosis.settings.range_mounts()
    sensors = [name for name, mount in mounts.items() if abs(mount.heading_rad) <= AHEAD_WITHIN_RAD]
    before = await snapshot(robot)
    sensors = [name for name in sensors if name in before.beams_m]
    if not sensors and not before.scans:
        return
    answer = await diagnosis.asker.ask(
        f"Place a box (as high as the lidar, as wide as two hands) {AHEAD_M:g} m straight ahead of the robot's middle, "
        f"step aside, and press Enter. {LEAVE_OUT}"
    )
    if answer is None or answer.lower() == SKIP:
        diagnosis.find(skip_check("ahead", "nothing was placed ahead", SOMEBODY))
        return
    after = await snapshot(robot)
    diagnosis.find(
        *[check_beam_ahead(sensor, before.beams_m[sensor], after.beams_m.get(sensor)) for sensor in sensors]
    )
    both = before.scans.keys() & after.scans.keys()
    diagnosis.find(
        *[check_ahead(name, before.scans[name], after.scans[name], AHEAD_M) for name in sorted(both)]
    )


async def _lift(diagnosis: Diagnosis, robot: Client) -> None:
    if diagnosis.settings.imu is None:
        return
    before = await snapshot(robot)
    if before.attitude is None:
        return
    answer = await diagnosis.asker.ask(
        f"Lift the front of the robot by a hand's breadth, hold it still, and press Enter. {LEAVE_OUT}"
    )
    if answer is None or answer.lower() == SKIP:
        diagnosis.find(skip_check("imu_tilt", "the robot was not lifted", SOMEBODY))
        return
    diagnosis.find(check_imu_lift(before.attitude, (await snapshot(robot)).attitude))


def _turns_between(before: Snapshot, after: Snapshot) -> Mapping[str, float]:
    old = before.position_rad
    return {name: angle - old.get(name, angle) for name, angle in after.position_rad.items()}


def _motion(diagnosis: Diagnosis, before: Snapshot, after: Snapshot) -> Pose2D:
    """``before_from_after`` by the encoders alone, as an arc: the odometry's heading may be the IMU's."""
    chassis, turned = diagnosis.settings.chassis, _turns_between(before, after)
    travel = Kinematics(chassis).twist([turned.get(wheel.name, 0.0) for wheel in chassis.wheels])
    half_rad = travel.angular_rad_s / 2
    chord_m = travel.linear_m_s * (math.sin(half_rad) / half_rad if half_rad else 1.0)
    return Pose2D(chord_m * math.cos(half_rad), chord_m * math.sin(half_rad), travel.angular_rad_s)


def _imu_turned(before: Snapshot, after: Snapshot) -> float | None:
    old, new = before.attitude, after.attitude
    if old is None or new is None or old.heading_rad is None or new.heading_rad is None:
        return None
    return wrap_angle(new.heading_rad - old.heading_rad)


def _lidar_motion(before: Snapshot, after: Snapshot, motion: Pose2D) -> list[Finding]:
    scans: Mapping[str, ScanTaken] = before.scans
    both = sorted(scans.keys() & after.scans.keys())
    return [check_motion(name, scans[name], after.scans[name], motion) for name in both]


def _number(answer: str | None) -> float:
    try:
        return float((answer or "0").replace(",", ".").removesuffix("cm").strip())
    except ValueError:
        return 0.0
