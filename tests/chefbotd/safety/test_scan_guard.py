"""The obstacle guard by scans: what is in the way of the robot's outline, on arcs too, and what is not."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from chefbotd.core.geometry import STANDING, Twist2D, WheelVelocities
from chefbotd.core.record import replace
from chefbotd.safety.guard import GuardParameters, ScanGuardParameters
from chefbotd.safety.outline import Box, Disc, Outline
from chefbotd.safety.scan_guard import CREEPING_M_S, NOT_SEEN, View, blocked_after, limit
from tests.budget import examples, sample

PARAMS = GuardParameters(deceleration_m_s2=0.5, reaction_s=0.1, max_age_s=0.5)
ROUND, LONG = Disc(0.18), Box(0.3, 0.15)
NOW_S = 50.0


def view(*points: tuple[float, float], age_s: float = 0.0, turn_s: float = 0.1, lidar: str = "top") -> View:
    """These points, measured so long ago."""
    return View(lidar, np.array(points).reshape(-1, 2), NOW_S - age_s, NOW_S - age_s, turn_s)


def wall(x0: float, y0: float, x1: float, y1: float, step_m: float = 0.01) -> list[tuple[float, float]]:
    """Points along a line."""
    count = round(math.dist((x0, y0), (x1, y1)) / step_m) + 1
    return [*zip(np.linspace(x0, x1, count).tolist(), np.linspace(y0, y1, count).tolist(), strict=True)]


def driven(
    outline: Outline, wanted: Twist2D, *views: View, params: GuardParameters = PARAMS
) -> tuple[Twist2D, str | None]:
    """What is left of it, and why."""
    motion, limited_by = limit(params, outline, views, wanted, NOW_S)
    assert isinstance(motion, Twist2D)
    return motion, limited_by


def test_a_point_ahead_by_hand() -> None:
    """0.6 m ahead of a disc of 0.18 with 0.02 around it and 0.05 before it: 0.35 m of room.

    With 0.1 s of reaction and a turn of 0.1 s: v 0.2 + v^2 = 0.35, so v = 0.5 (sqrt(0.04 + 1.4) - 0.2) = 0.5 m/s.
    """
    assert driven(ROUND, Twist2D(1.0, 0.0), view((0.6, 0.0))) == (
        Twist2D(pytest.approx(0.5), 0.0),
        "obstacle:top",
    )
    assert driven(ROUND, Twist2D(0.4, 0.0), view((0.6, 0.0))) == (Twist2D(0.4, 0.0), None)


def test_the_age_of_a_scan_lowers_the_speed() -> None:
    """0.3 s instead of a turn's 0.1: v 0.4 + v^2 = 0.35, so v = 0.5 (sqrt(0.16 + 1.4) - 0.4) = 0.4245 m/s."""
    (motion, _) = driven(ROUND, Twist2D(1.0, 0.0), view((0.6, 0.0), age_s=0.3))
    assert motion.linear_m_s == pytest.approx(0.4245, abs=1e-4)


def coming(now_m: float, between_m: float, before_m: float) -> View:
    """A point so far ahead, and how far ahead it was 0.1 s and 0.2 s ago."""
    between, before = np.array([[between_m, 0.0]]), np.array([[before_m, 0.0]])
    return replace(view((now_m, 0.0)), earlier=(lambda: between, lambda: before), before_s=0.2)


def test_what_comes_takes_its_part_of_the_room_by_hand() -> None:
    """The same point was 0.05 m farther away 0.2 s ago: until the robot stands, it comes on at 0.25 m/s.

    At 0.3 m/s the robot takes 0.3 * 0.2 + 0.3^2 = 0.15 m of the 0.35 m in 0.2 s + 0.3 / 0.5 s, and that takes
    0.25 * 0.8 = 0.2 m meanwhile.
    """
    motion, limited_by = driven(ROUND, Twist2D(1.0, 0.0), coming(0.6, 0.625, 0.65))
    assert (motion.linear_m_s, limited_by) == (pytest.approx(0.3), "obstacle:top")


@pytest.mark.parametrize(
    ("between_m", "before_m"),
    [(0.61, 0.62), (0.55, 0.5), (1.3, 2.0), (0.9, 0.9), (0.6, 0.9)],
    ids=["noise", "goes away", "faster than anybody", "missed until now", "missed at first"],
)
def test_what_does_not_come_takes_no_room(between_m: float, before_m: float) -> None:
    """2 cm is noise; nothing comes 1.4 m in 0.2 s, nor 0.3 m in one turn and none in the other: 0.5 m/s as by hand."""
    motion, _ = driven(ROUND, Twist2D(1.0, 0.0), coming(0.6, between_m, before_m))
    assert motion.linear_m_s == pytest.approx(0.5)


def test_who_comes_faster_than_the_robot_could_stand_lets_it_not_begin() -> None:
    """He comes 0.3 m in 0.2 s: in the 0.2 s before it can brake he takes 0.3 m of the 0.25 m of room."""
    assert driven(ROUND, Twist2D(0.3, 0.0), coming(0.5, 0.65, 0.8)) == (STANDING, "obstacle:top")


@given(st.floats(0.3, 3.0), st.floats(0.0, 2.0), st.floats(0.05, 1.0), st.floats(0.05, 1.0))
@example(1.2414721202881551, 2.0, 0.8125, 0.5)  # at the bound itself a sum's last bit decided
@settings(max_examples=examples(100))
def test_who_asks_for_less_gets_no_more(ahead_m: float, comes_m_s: float, asked: float, less: float) -> None:
    """Before something that comes at up to a runner's speed, a slower command is limited by it as a faster one is."""
    assume(less <= asked)
    there = coming(ahead_m, ahead_m + 0.1 * comes_m_s, ahead_m + 0.2 * comes_m_s)
    (faster, _), (slower, _) = (driven(ROUND, Twist2D(speed, 0.0), there) for speed in (asked, less))
    assert slower.linear_m_s <= max(faster.linear_m_s, CREEPING_M_S) + 1e-9


@pytest.mark.parametrize("outline", [ROUND, LONG], ids=str)
def test_at_the_stop_distance_it_stands_and_may_leave(outline: Outline) -> None:
    """5 cm before the front nothing goes forward; back and, where nothing is touched by it, turning go on."""
    front_m = 0.18 if outline is ROUND else 0.3
    ahead = view(*wall(front_m + 0.069, -1, front_m + 0.069, 1))
    assert driven(outline, Twist2D(0.3, 0.0), ahead) == (STANDING, "obstacle:top")
    assert driven(outline, Twist2D(-0.3, 0.0), ahead) == (Twist2D(-0.3, 0.0), None)
    turning, _ = driven(ROUND, Twist2D(0.0, -1.1), ahead)
    assert turning == Twist2D(0.0, -1.1)


def stands(outline: Outline, steps: list[tuple[Twist2D, View]]) -> list[Twist2D]:
    """What is left of each motion, in their order, before what is seen then."""
    allowed, blocked = [], STANDING
    for wanted, seen in steps:
        motion, _ = limit(PARAMS, outline, [seen], wanted, NOW_S, blocked)
        assert isinstance(motion, Twist2D)
        blocked = blocked_after(blocked, wanted, motion)
        allowed.append(motion)
    return allowed


def ahead_m(room_m: float) -> View:
    """A wall so far beyond where a disc of 0.18 m stands: 0.18 + 0.02 + 0.05 = 0.25 m from its middle."""
    return view(*wall(0.25 + room_m, -1, 0.25 + room_m, 1))


@pytest.mark.parametrize("wanted", [Twist2D(0.3, 0.0), Twist2D(0.3, 0.02), Twist2D(0.15, -0.03)])
def test_a_stand_does_not_end_with_the_noise_of_a_scan(wanted: Twist2D) -> None:
    """Up to 2 cm more it does not go ahead, whatever it turns meanwhile; from there on it does, and anew to the end."""
    readings = [ahead_m(room_m) for room_m in (0.0, 0.012, -0.01, 0.018, 0.04, 0.018)]
    linear_m_s = [motion.linear_m_s for motion in stands(ROUND, [(wanted, seen) for seen in readings])]
    assert linear_m_s[:4] == [0.0] * 4
    assert all(0.01 < speed_m_s <= 0.3 for speed_m_s in linear_m_s[4:])


def test_a_stand_ends_at_once_when_the_way_is_free_of_it() -> None:
    """Who stood in the way has stepped aside: all of the motion."""
    ahead = Twist2D(0.3, 0.0)
    assert stands(ROUND, [(ahead, ahead_m(0.0)), (ahead, view((3.0, 0.0)))])[-1] == ahead


def test_out_of_a_stand_every_other_direction_is_free() -> None:
    """Ahead it stands; turning, backing off, and after that ahead again go on as if it had not stood."""
    ahead, near = Twist2D(0.3, 0.0), ahead_m(0.0)
    for other in (Twist2D(-0.3, 0.0), Twist2D(0.0, 0.7), Twist2D(-0.2, 0.4)):
        assert stands(ROUND, [(ahead, near), (other, near)])[-1] == other
    assert stands(ROUND, [(ahead, near), (Twist2D(0.0, 0.7), near), (ahead, ahead_m(0.015))])[-1] == STANDING
    moved_off = stands(ROUND, [(ahead, near), (Twist2D(-0.3, 0.0), near), (ahead, ahead_m(0.015))])[-1]
    assert moved_off.linear_m_s > 0.01


def test_a_turn_that_was_brought_to_a_stand_has_the_hysteresis_too() -> None:
    """A point 0.32 m from a long robot's middle touches the flank, 0.17 m with what is around it, at asin(17 / 32).

    That is 0.56 rad; 0.05 m before that, 0.156 rad, it stands, and up to 0.07 m, 0.219 rad, it stands on. An arc of
    which nothing was allowed does not bar the turn.
    """
    left, right, arc = Twist2D(0.0, 0.7), Twist2D(0.0, -0.7), Twist2D(0.02, 0.7)
    within, just, beyond = (
        view((0.32 * math.cos(0.56 + rad), 0.32 * math.sin(0.56 + rad))) for rad in (0.15, 0.2, 0.26)
    )
    assert stands(LONG, [(left, within), (left, just), (left, within)]) == [STANDING] * 3
    assert stands(LONG, [(left, just)])[0].angular_rad_s > 0.05
    assert stands(LONG, [(left, within), (left, beyond), (left, just)])[-1].angular_rad_s > 0.05
    assert stands(LONG, [(left, within), (right, just), (left, just)])[-1].angular_rad_s > 0.05
    assert blocked_after(STANDING, arc, STANDING) == Twist2D(1.0, 0.0)


def test_a_wall_at_the_side_stops_nobody() -> None:
    """Straight along it, 3 cm beside the robot, forwards and back, and with a doorway's frames on both sides."""
    for outline in (ROUND, LONG):
        beside_m = (0.18 if outline is ROUND else 0.15) + 0.03
        left = view(*wall(-2, beside_m, 4, beside_m), *wall(0.5, -beside_m, 0.6, -beside_m))
        for linear in (0.5, -0.5):
            assert driven(outline, Twist2D(linear, 0.0), left) == (Twist2D(linear, 0.0), None)


def test_towards_the_wall_at_the_side_it_is_slowed() -> None:
    """A left turn that leads into the left wall, 4 cm beside the robot: no axis as fast as was wanted.

    2 cm beside it only the turning is left, which brings a round robot no closer.
    """
    motion, limited_by = driven(ROUND, Twist2D(0.3, 0.8), view(*wall(-2, 0.24, 4, 0.24)))
    assert limited_by == "obstacle:top"
    assert 0 < motion.linear_m_s < 0.3
    assert 0 < motion.angular_rad_s < 0.8
    assert driven(ROUND, Twist2D(0.3, 0.8), view(*wall(-2, 0.201, 4, 0.201)))[0] == Twist2D(0.0, 0.8)


def test_what_is_low_at_the_side_stops_a_turn_in_place() -> None:
    """A long robot beside a wall cannot turn; a round one can. It may still drive along the wall."""
    right = view(*wall(-2, -0.19, 2, -0.19))
    assert driven(LONG, Twist2D(0.0, 0.7), right)[0] == STANDING
    assert driven(LONG, Twist2D(0.0, -0.7), right)[0] == STANDING
    assert driven(Disc(0.165), Twist2D(0.0, 0.7), right) == (Twist2D(0.0, 0.7), None)
    assert driven(LONG, Twist2D(0.3, 0.0), right) == (Twist2D(0.3, 0.0), None)


def test_a_long_robot_may_begin_to_turn_where_there_is_room() -> None:
    """A wall 0.3 m to the right: the corner, 0.3354 m from the middle, would touch; it turns slowly towards that."""
    right = view(*wall(-2, -0.3, 2, -0.3))
    motion, limited_by = driven(LONG, Twist2D(0.0, 2.0), right)
    assert limited_by == "obstacle:top"
    assert 0.1 < motion.angular_rad_s < 0.9
    assert driven(LONG, Twist2D(0.0, 2.0), view(*wall(-2, -0.45, 2, -0.45)))[1] is None


def test_driving_and_turning_by_an_obstacle_ahead_turns() -> None:
    """At the stop distance before a wall: what is asked for as driving and turning goes on as turning."""
    ahead = view(*wall(0.24, -1, 0.24, 1))
    assert driven(ROUND, Twist2D(0.3, 0.9), ahead) == (Twist2D(0.0, 0.9), "obstacle:top")


@pytest.mark.parametrize("linear_m_s", [0.002, 0.03, 0.3])
@pytest.mark.parametrize("turn_rad_s", [0.15, -1.2])
def test_a_disc_turns_beside_a_wall_and_no_part_of_its_driving_goes_on(
    linear_m_s: float, turn_rad_s: float
) -> None:
    """A wall ahead, 1 cm from the rim of 0.18 m: a turn moves no point of the rim nearer, driving ahead does."""
    ahead = view(*wall(0.19, -1, 0.19, 1))
    assert driven(ROUND, Twist2D(0.0, turn_rad_s), ahead) == (Twist2D(0.0, turn_rad_s), None)
    left, limited_by = driven(ROUND, Twist2D(linear_m_s, turn_rad_s), ahead)
    assert left.linear_m_s <= 0.001, left
    assert limited_by == (None if left.linear_m_s else "obstacle:top")


def test_a_corner_that_would_hit_stops_a_turn_on_the_spot() -> None:
    """0.3 by 0.15 m to the corner: 0.335 m. A wall 0.25 m to the left lets it drive along, and not turn across.

    By 0.25 = 0.3 sin a + 0.15 cos a the front corner is there after a = 26 degrees; with 2 cm around it it touches
    sooner, so at 1.2 rad/s, braking with 1 rad/s^2, it is slowed, and at 0.18 m, within 5 cm, it does not begin.
    """
    along = view(*wall(-1, 0.25, 1, 0.25))
    assert driven(LONG, Twist2D(0.3, 0.0), along) == (Twist2D(0.3, 0.0), None)
    slowed, limited_by = driven(LONG, Twist2D(0.0, 1.2), along)
    assert limited_by == "obstacle:top"
    assert 0.0 <= slowed.angular_rad_s < 0.6
    near = view(*wall(-1, 0.18, 1, 0.18))
    assert driven(LONG, Twist2D(0.0, 1.2), near) == (STANDING, "obstacle:top")


def test_behind_and_at_the_side_are_looked_at_as_well() -> None:
    """Backwards into a chair leg; an arc that sweeps one at the outside."""
    assert driven(ROUND, Twist2D(-0.3, 0.0), view((-0.24, 0.01)))[0] == STANDING
    outside = view((0.28, -0.25))
    assert driven(ROUND, Twist2D(0.3, 0.0), outside) == (Twist2D(0.3, 0.0), None)
    assert driven(ROUND, Twist2D(0.3, -0.9), outside)[1] == "obstacle:top"


def test_the_robot_itself_is_no_obstacle() -> None:
    """Points within the outline, such as a mast's."""
    mast = view((0.1, 0.05), (-0.15, 0.0), (0.0, -0.17))
    assert driven(ROUND, Twist2D(0.5, 0.4), mast) == (Twist2D(0.5, 0.4), None)


def test_wheels_of_their_own_speeds_are_slowed_together() -> None:
    """0.35 m of room as above: 0.5 m/s of 1.0, every wheel at half its speed."""
    wanted = WheelVelocities((20.0, 18.0), Twist2D(1.0, 0.0))
    motion, limited_by = limit(PARAMS, ROUND, [view((0.6, 0.0))], wanted, NOW_S)
    assert motion == WheelVelocities(
        (pytest.approx(10.0), pytest.approx(9.0)), Twist2D(pytest.approx(0.5), 0.0)
    )
    assert limited_by == "obstacle:top"


def test_a_silent_lidar_leaves_a_crawl() -> None:
    """After 0.5 s without a scan no part of the robot is faster than 0.1 m/s; where 0 is configured it stands."""
    late = view((3.0, 0.0), age_s=0.6)
    assert driven(ROUND, Twist2D(0.4, 0.0), late) == (Twist2D(pytest.approx(0.1), 0.0), "silent:top")
    assert driven(ROUND, Twist2D(0.05, 0.0), late) == (Twist2D(0.05, 0.0), None)
    turning, _ = driven(ROUND, Twist2D(0.0, 2.0), late)
    assert turning.angular_rad_s == pytest.approx(0.1 / 0.18)
    curve, _ = driven(
        ROUND, Twist2D(0.3, -0.2), late
    )  # its rim is 0.3 + 0.2 * 0.18: the same curve, more slowly
    assert (curve.linear_m_s, curve.angular_rad_s) == pytest.approx((0.3 * 0.1 / 0.336, -0.2 * 0.1 / 0.336))
    never = View("low", NOT_SEEN, -math.inf, -math.inf, 0.0)
    assert driven(ROUND, Twist2D(0.4, 0.0), view((3.0, 0.0)), never)[1] == "silent:low"
    still = GuardParameters(scan=ScanGuardParameters(silent_speed_m_s=0.0))
    assert driven(ROUND, Twist2D(0.4, 0.3), late, params=still) == (STANDING, "silent:top")


def test_of_two_lidars_the_one_that_sees_more_in_the_way_counts() -> None:
    """The nearer point is named."""
    near, far = view((0.5, 0.0), lidar="low"), view((0.6, 0.0))
    assert driven(ROUND, Twist2D(1.0, 0.0), far, near)[1] == "obstacle:low"


MOTIONS = st.builds(Twist2D, st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))
DISCS = st.tuples(st.floats(-math.pi, math.pi), st.floats(0.03, 1.2), st.floats(0.02, 0.15))


def rim(x: float, y: float, radius: float) -> np.ndarray:
    """Points about a disc: what a lidar may see of it, and more."""
    angles = np.linspace(0, math.tau, 60)
    return np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=1)


class Drive:
    """A robot that follows what the guard leaves with the limits' ramps, 20 times a second, and one step late."""

    def __init__(self, outline: Outline, obstacles: list[np.ndarray]) -> None:
        self.outline, self.world = outline, np.concatenate(obstacles)
        self.x = self.y = self.heading = self.v = self.w = 0.0
        self.nearest_m = math.inf

    def seen(self) -> np.ndarray:
        """The world from where the robot is."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        dx, dy = self.world[:, 0] - self.x, self.world[:, 1] - self.y
        return np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=1)

    def run(self, wanted: Twist2D, seconds: float, dt_s: float = 0.05) -> "Drive":
        """Drive so, with scans of 10 Hz that are brought up to date by odometry."""
        target = STANDING
        for step in range(round(seconds / dt_s)):
            age_s = 0.05 + 0.05 * (step % 2)
            now = View("top", self.seen(), NOW_S - age_s, NOW_S, 0.1)
            allowed, _ = limit(PARAMS, self.outline, [now], wanted, NOW_S)
            for _ in range(10):
                self._ramp(target, dt_s / 10)
                self._move(dt_s / 10)
            assert isinstance(allowed, Twist2D)
            target = allowed
        return self

    def _ramp(self, target: Twist2D, dt_s: float) -> None:
        self.v += np.clip(target.linear_m_s - self.v, -1.0 * dt_s, 1.0 * dt_s)
        self.w += np.clip(target.angular_rad_s - self.w, -2.0 * dt_s, 2.0 * dt_s)

    def _move(self, dt_s: float) -> None:
        middle = self.heading + self.w * dt_s / 2
        self.x += self.v * dt_s * math.cos(middle)
        self.y += self.v * dt_s * math.sin(middle)
        self.heading += self.w * dt_s
        seen = self.seen()
        self.nearest_m = min(self.nearest_m, float(self.outline.distances(seen[:, 0], seen[:, 1]).min()))


@pytest.mark.parametrize("outline", sample([ROUND, LONG]), ids=str)
@settings(max_examples=examples(30), deadline=None)
@given(wanted=MOTIONS, disc=DISCS)
def test_a_disc_in_the_way_is_never_touched(
    outline: Outline, wanted: Twist2D, disc: tuple[float, float, float]
) -> None:
    """From rest, whatever is asked for and wherever the disc stands: for 6 s nothing comes nearer than 5 mm."""
    bearing, gap_m, radius = disc
    away_m = outline.radius_m + gap_m + radius
    drive = Drive(outline, [rim(away_m * math.cos(bearing), away_m * math.sin(bearing), radius)])
    assert drive.run(wanted, 6.0).nearest_m > 0.005


@pytest.mark.slow
@settings(max_examples=examples(20), deadline=None)
@given(first=MOTIONS, then=MOTIONS, disc=DISCS)
def test_nor_after_a_change_of_mind_at_speed(
    first: Twist2D, then: Twist2D, disc: tuple[float, float, float]
) -> None:
    """2 s of one motion and 4 s of another, among three discs."""
    bearing, gap_m, radius = disc
    away_m = ROUND.radius_m + gap_m + radius
    discs = [
        rim(away_m * math.cos(bearing + turn), away_m * math.sin(bearing + turn), radius)
        for turn in (0.0, 1.9, -2.2)
    ]
    drive = Drive(ROUND, discs)
    assert drive.run(first, 2.0).run(then, 4.0).nearest_m > 0.0


@settings(max_examples=examples(40), deadline=None)
@given(wanted=MOTIONS, disc=DISCS)
def test_less_is_driven_never_more_nor_the_other_way(
    wanted: Twist2D, disc: tuple[float, float, float]
) -> None:
    """Each axis is between nothing and what was wanted."""
    bearing, gap_m, radius = disc
    away_m = LONG.radius_m + gap_m + radius
    points = rim(away_m * math.cos(bearing), away_m * math.sin(bearing), radius)
    motion, limited_by = driven(LONG, wanted, View("top", points, NOW_S, NOW_S, 0.1))
    for is_now, was in (
        (motion.linear_m_s, wanted.linear_m_s),
        (motion.angular_rad_s, wanted.angular_rad_s),
    ):
        assert is_now * was >= 0
        assert abs(is_now) <= abs(was) + 1e-12
    assert (limited_by is None) == (motion == wanted)


@settings(max_examples=examples(40), deadline=None)
@given(bearing=st.floats(-math.pi, math.pi))
def test_a_round_robot_at_one_obstacle_can_always_leave(bearing: float) -> None:
    """Stopped before it: driving away, or turning, is never refused."""
    points = rim(0.29 * math.cos(bearing), 0.29 * math.sin(bearing), 0.08)
    assume(abs(math.cos(bearing)) > 0.05)
    away = Twist2D(-0.2 * math.copysign(1, math.cos(bearing)), 0.0)
    assert driven(ROUND, away, View("top", points, NOW_S, NOW_S, 0.1)) == (away, None)
    turning = Twist2D(0.0, 0.9)
    assert driven(ROUND, turning, View("top", points, NOW_S, NOW_S, 0.1)) == (turning, None)


@pytest.mark.parametrize(
    ("point", "twist", "share"),
    [
        ((0.3, 0.6 - 0.6 * math.cos(math.pi / 6)), Twist2D(0.3, 0.5), 0.56867),
        ((0.3, -0.6 + 0.6 * math.cos(math.pi / 6)), Twist2D(0.3, -0.5), 0.56867),
        ((-0.3, -0.6 + 0.6 * math.cos(math.pi / 6)), Twist2D(-0.3, 0.5), 0.56867),
        ((0.2, 0.2), Twist2D(0.2, 1.0), 0.56629),
        ((0.2, -0.2), Twist2D(0.2, -1.0), 0.56629),
    ],
)
def test_a_point_on_the_arc_by_hand(point: tuple[float, float], twist: Twist2D, share: float) -> None:
    """On a circle of 0.6 m a point 30 degrees on touches 0.2 m about the middle 2 asin(0.1 / 0.6) = 0.3349 rad before.

    Less 0.05 m of the circle, 0.1054 rad are left: 0.2107 s at 0.5 rad/s, braked in 1 / k = 0.3 / 0.5 s after 0.2 s:
    k (sqrt(0.2^2 + 2 0.2107 / k) - 0.2). On 0.2 m, at a quarter: 0.2736 s, and k = 1 of turning is the smaller.
    """
    wanted = WheelVelocities((7.0, 11.0), twist)
    motion, limited_by = limit(PARAMS, ROUND, [view(point)], wanted, NOW_S)
    assert isinstance(motion, WheelVelocities)
    assert motion.rad_s == pytest.approx((7.0 * share, 11.0 * share), abs=1e-3)
    assert limited_by == "obstacle:top"


@pytest.mark.parametrize(("cos", "stops"), [(0.0016, False), (0.005, True), (-0.005, False)])
def test_what_hardly_comes_closer_does_not_stop(cos: float, stops: bool) -> None:
    """1 cm beside the robot, all but abeam: at 0.3 m/s it closes by 0.5 mm/s, by 1.5 mm/s, and goes away."""
    point = (0.19 * cos, -0.19 * math.sqrt(1 - cos * cos))
    motion, _ = driven(ROUND, Twist2D(0.3, 0.0), view(point))
    assert (motion == STANDING) is stops


def test_a_scan_may_be_just_as_old_as_it_may_be() -> None:
    """0.5 s: heard; a millisecond more: silent."""
    assert driven(ROUND, Twist2D(0.4, 0.0), view((0.6, 0.0), age_s=0.5))[1] == "obstacle:top"
    assert driven(ROUND, Twist2D(0.4, 0.0), view((3.0, 0.0), age_s=0.501))[1] == "silent:top"


def test_the_faster_it_is_the_farther_it_looks() -> None:
    """1.2 m ahead at 1 m/s, 0.95 m of room: v 0.2 + v^2 = 0.95, so v = 0.5 (sqrt(0.04 + 3.8) - 0.2) = 0.8798 m/s."""
    (motion, _) = driven(ROUND, Twist2D(1.0, 0.0), view((1.2, 0.0)))
    assert motion.linear_m_s == pytest.approx(0.8798, abs=1e-4)
