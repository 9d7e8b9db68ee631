"""Scans brought up to date for the guard: the robot's way since, a pose set anew, two turns together."""

import math

import numpy as np
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.core.events import WheelsMeasured
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.scan import LaserScan
from chefbotd.driving.scan_watch import ScanWatch, outline_of
from chefbotd.safety.guard import GuardParameters
from chefbotd.safety.outline import Box, Disc
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import load, packaged

SETTINGS = load()
TOP = LidarParameters.model_validate(
    {"name": "top", "model": "ld19", "device": "/dev/top", "mount_x_m": 0.1, "mount_yaw_rad": 0.5}
)
MOUNT = Pose2D(0.1, 0.0, 0.5)
RADIUS_M = 0.045


class Rig:
    """A watch in front of one point, on a robot that rolls."""

    def __init__(self, lidar: LidarParameters = TOP) -> None:
        self.bus, self.clock = Bus(), ManualClock(10.0)
        self.errors: list[Exception] = []
        self.watch = ScanWatch(
            self.bus,
            self.clock,
            GuardParameters(),
            SETTINGS.chassis,
            [lidar],
            Disc(0.18),
            on_error=self.errors.append,
        )

    def roll(self, left_m: float, right_m: float, seconds: float = 0.05) -> None:
        """The wheels roll so far."""
        self.clock.advance(seconds)
        now_s, travel = self.clock.now_s(), (left_m / RADIUS_M, right_m / RADIUS_M)
        self.bus.publish(WheelsMeasured(now_s, now_s, now_s, (0.0, 0.0), travel, (0.0, 0.0)))

    def scan(self, x_m: float, y_m: float, *, lidar: str = "top", before_s: float = 0.0) -> None:
        """Two beams of the lidar see one thing, given in the robot's frame, ``before_s`` before the end of its turn."""
        self.beams((x_m, y_m), (x_m, y_m + 0.001), lidar=lidar, before_s=before_s)

    def beams(self, *points_m: tuple[float, float], lidar: str = "top", before_s: float = 0.0) -> None:
        """The lidar sees these points, each with a beam of its own, and nothing else."""
        seen = [(x_m - MOUNT.x_m, y_m) for x_m, y_m in points_m]
        bearing = np.array([*(math.atan2(dy, dx) - MOUNT.heading_rad for dx, dy in seen), 1.0, 2.0, 3.0])
        ranges = np.array([*(math.hypot(dx, dy) for dx, dy in seen), 0.0, 0.0, 0.0])
        now_s = self.clock.now_s()
        after_s = np.array([*(-before_s for _ in seen), -0.08, -0.05, 0.0])
        scan = LaserScan(now_s, bearing, ranges, after_s)
        self.bus.publish(ScanMeasured(now_s, lidar, MOUNT, scan))

    def allowed_m_s(self, wanted: Twist2D | None = None) -> float:
        """How fast it may go forward."""
        motion, _ = self.watch.limit(wanted or Twist2D(2.0, 0.0), self.clock.now_s())
        assert isinstance(motion, Twist2D)
        assert not self.errors
        return motion.linear_m_s


def speed_m_s(room_m: float, delay_s: float) -> float:
    """``v d + v^2 / 2a = room`` with a = 0.5."""
    return 0.5 * (math.sqrt(delay_s**2 + 4 * room_m) - delay_s)


def test_a_point_stands_where_the_mounted_lidar_saw_it() -> None:
    """0.8 m ahead: 0.8 - 0.18 - 0.02 - 0.05 = 0.55 m of room; a turn of 0.08 s and 0.1 s of reaction."""
    rig = Rig()
    rig.roll(0, 0)
    rig.scan(0.8, 0.0)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.55, 0.18), abs=0.002)


def test_what_the_robot_drives_after_a_scan_is_taken_off() -> None:
    """0.1 m of way, in 0.1 s: the room is 0.45 m, and the scan 0.1 s old."""
    rig = Rig()
    rig.roll(0, 0)
    rig.scan(0.8, 0.0)
    rig.roll(0.05, 0.05)
    rig.roll(0.05, 0.05)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.45, 0.2), abs=0.002)


def test_what_it_turns_is_taken_off_as_well() -> None:
    """A quarter to the left, on a track of 0.3 m: what was ahead is at the right, and nothing is ahead."""
    rig = Rig()
    rig.roll(0, 0)
    rig.scan(0.5, 0.0)
    for _ in range(10):
        rig.roll(-0.015 * math.pi / 2, 0.015 * math.pi / 2, 0.01)
    assert rig.allowed_m_s(Twist2D(0.4, 0.0)) == 0.4
    assert rig.allowed_m_s(Twist2D(0.4, -2.0)) < 0.4


def test_the_motion_during_a_turn_is_undone() -> None:
    """Seen 0.1 s before the turn's end, in which the robot drove 0.06 m: it is 0.06 m nearer."""
    rig = Rig()
    rig.roll(0, 0)
    rig.roll(0.03, 0.03)
    rig.roll(0.03, 0.03)
    rig.scan(0.8, 0.0, before_s=0.1)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.49, 0.2), abs=0.003)


def test_what_one_turn_missed_the_one_before_has_seen() -> None:
    """A leg that is seen in every second turn only is an obstacle all the time, and is forgotten after two turns."""
    rig = Rig()
    rig.roll(0, 0)
    rig.scan(0.5, 0.0)
    rig.roll(0, 0, 0.1)
    rig.scan(0.5, 2.0)
    assert rig.allowed_m_s() < 0.5
    rig.roll(0, 0, 0.1)
    rig.scan(0.5, 2.0)
    assert rig.allowed_m_s() == 2.0


def test_what_comes_from_turn_to_turn_leaves_less_room() -> None:
    """It comes 0.03 m in each 0.1 s, to 0.8 m: of its 0.55 m of room it takes 0.3 m/s until the robot stands.

    ``v (d + c / a) + v^2 / 2a = room - c d`` with c = 0.3 and a = 0.5: as if 0.6 s more passed with 0.054 m less.
    """
    rig = Rig()
    for x_m in (0.89, 0.86, 0.83, 0.8):
        rig.roll(0, 0, 0.1)
        rig.scan(x_m, 0.0)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.55 - 0.3 * 0.18, 0.18 + 0.6), abs=0.01)


@pytest.mark.parametrize(
    "seen",
    [
        (0.86, 0.83, 0.8),
        (1.1, 1.1, 1.1, 0.8),
        (1.1, 1.1, 0.8, 0.8),
        (0.89, 0.86, None, None, None, 0.83, 0.8),
    ],
    ids=["three turns", "missed until now", "missed at first", "silent between"],
)
def test_what_is_not_known_to_come_takes_no_room(seen: tuple[float | None, ...]) -> None:
    """The robot may go as fast as before what stands there: three turns are too few, and so are those of long ago."""
    rig = Rig()
    for x_m in seen:
        rig.roll(0, 0, 0.1)
        if x_m is not None:
            rig.scan(x_m, 0.0)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.55, 0.18), abs=0.002)


def test_a_silent_lidar_is_told_and_leaves_a_crawl() -> None:
    """Never heard, and 0.6 s after its last scan."""
    rig = Rig()
    assert rig.watch.limit(Twist2D(0.4, 0.0), 10.0) == (Twist2D(pytest.approx(0.1), 0.0), "silent:top")
    rig.scan(3.0, 0.0)
    assert rig.allowed_m_s(Twist2D(0.4, 0.0)) == 0.4
    rig.clock.advance(0.6)
    assert rig.allowed_m_s(Twist2D(0.4, 0.0)) == pytest.approx(0.1)


def test_a_lidar_that_does_not_guard_is_not_asked() -> None:
    """Neither what it sees nor its silence counts; nor does a scan of a lidar that nobody configured."""
    rig = Rig(TOP.model_copy(update={"guards": False}))
    rig.scan(0.3, 0.0)
    rig.scan(0.3, 0.0, lidar="another")
    assert rig.allowed_m_s() == 2.0


def test_the_outline_holds_body_and_wheels() -> None:
    """ChefBot is round, 0.36 m across; KHAN's wheels stand out of a body of 0.2 by 0.1 m, and are all without one."""
    assert outline_of(SETTINGS.chassis, SETTINGS.body_size_m, 0.0) == Disc(0.18)
    khan = load(packaged("khan"))
    half_width = (0.189 + 0.025) / 2
    assert outline_of(khan.chassis, None, 0.185) == Box(pytest.approx(0.1225), pytest.approx(half_width))
    assert outline_of(khan.chassis, (0.3, 0.1), 0.185) == Box(0.15, pytest.approx(half_width))
    assert outline_of(khan.chassis, (0.3, None), 0.185) == Disc(pytest.approx(math.hypot(0.1225, half_width)))


def test_a_stand_outlasts_the_noise_of_scans_and_a_restored_state() -> None:
    """Ahead, at 0.18 + 0.02 + 0.05 = 0.25 m, it stands, 1.5 cm more change nothing, and 4 cm more are a way again."""
    rig, other = Rig(), Rig()
    rig.roll(0, 0)
    rig.scan(0.25, 0.0)
    assert rig.allowed_m_s() == 0.0
    for _ in range(3):
        rig.roll(0, 0, 0.1)
        rig.scan(0.265, 0.0)
        assert rig.allowed_m_s() == 0.0
    other.clock.advance(rig.clock.now_s() - other.clock.now_s())
    other.watch.restore(rig.watch.state())
    assert other.allowed_m_s() == 0.0
    for _ in range(3):
        rig.roll(0, 0, 0.1)
        rig.scan(0.29, 0.0)
    assert rig.allowed_m_s() == pytest.approx(speed_m_s(0.02, 0.18), abs=0.002)
    rig.scan(0.265, 0.0)
    assert rig.allowed_m_s() > 0.01


def test_a_lone_point_is_no_obstacle_until_the_next_turn_confirms_it() -> None:
    """One beam on something 0.5 m ahead, for the first time in the third turn: free, and an obstacle in the fourth."""
    rig = Rig()
    for turn in range(4):
        rig.roll(0, 0, 0.1)
        rig.beams((0.5, 0.0)) if turn >= 2 else rig.beams((0.1, 2.0), (0.1, 2.01))
        assert (rig.allowed_m_s(Twist2D(1.0, 0.0)) == 1.0) == (turn < 3), turn


def test_noise_that_is_somewhere_else_in_each_turn_stops_nobody() -> None:
    """A lone point in each turn, 10 cm from that of the turn before: never an obstacle after the first turn."""
    rig = Rig()
    for turn in range(20):
        rig.roll(0, 0, 0.1)
        rig.beams((0.4 + 0.1 * (turn % 5), 0.1 * (turn % 2)))
        assert turn < 2 or rig.allowed_m_s(Twist2D(1.0, 0.0)) == 1.0, turn


def test_two_beams_on_a_leg_stop_it_at_once() -> None:
    """A leg of 2 cm, 0.5 m ahead, steps in front of the robot: an obstacle in the turn that sees it first."""
    rig = Rig()
    for _ in range(3):
        rig.roll(0, 0, 0.1)
        rig.beams((0.1, 2.0), (0.1, 2.01))
    assert rig.allowed_m_s(Twist2D(1.0, 0.0)) == 1.0
    rig.roll(0, 0, 0.1)
    rig.beams((0.5, 0.0), (0.5, 0.006))
    assert rig.allowed_m_s(Twist2D(1.0, 0.0)) < 0.6
