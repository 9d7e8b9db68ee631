"""Missed readings: what a range sensor saw stays until readings agree, or the robot has turned or moved away."""

import math
import random
from collections.abc import Callable

import pytest

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.safety import guard, range_memory
from chefbotd.safety.guard import Beams, GuardParameters, from_mounts
from chefbotd.safety.range_memory import NOTHING, Believed, RangeMemoryParameters

PARAMETERS = GuardParameters(stop_distance_m=0.15, deceleration_m_s2=0.5, reaction_s=0.1, max_age_s=0.5)
FRONT = {"front": Pose2D(0.15)}
MEMORY = RangeMemoryParameters()


def read(
    before: Believed, *distances_m: float, shortened_m: float = 0.0, turned_rad: float = 0.0
) -> Believed:
    """What is believed after these readings, before each of which the robot moved so."""
    for distance_m in distances_m:
        before = range_memory.add_reading(
            MEMORY,
            before,
            distance_m,
            shortened_m,
            turned_rad,
            stand_m=0.15,
            hysteresis_m=0.02,
            max_range_m=4.0,
            field_of_view_rad=0.26,
        )
    return before


MISS = math.inf


def needed(
    believed: Believed, *distances_m: float, memory: RangeMemoryParameters = MEMORY, most: int = 100
) -> int:
    """How many of these readings, again and again, it takes until a thing is gone."""
    held_m = believed.distance_m
    for number in range(most):
        believed = range_memory.add_reading(
            memory,
            believed,
            distances_m[number % len(distances_m)],
            0.0,
            0.0,
            stand_m=0.15,
            hysteresis_m=0.02,
            max_range_m=4.0,
            field_of_view_rad=0.26,
        )
        if believed.distance_m != held_m:
            return number + 1
    return most


def test_a_miss_between_good_readings_is_no_free_way() -> None:
    """0.5 m, nothing, 0.5 m: it is 0.5 m throughout; a nearer reading counts at once."""
    assert read(NOTHING, 0.5, MISS).distance_m == 0.5
    assert read(NOTHING, 0.5, MISS, 0.5).distance_m == 0.5
    assert read(NOTHING, 0.5, MISS, 0.3).distance_m == 0.3


def test_one_too_far_is_a_miss_as_well() -> None:
    """3 m between readings of 0.5 m; a centimetre or two more is the same thing."""
    assert read(NOTHING, 0.5, 3.0).distance_m == 0.5
    assert read(NOTHING, 0.5, 0.52).distance_m == 0.52


def test_five_readings_of_an_unknown_sensor_agree_on_a_free_way() -> None:
    """0.05^5 is 3e-7, below one in a million; four are not enough. The nearest of them counts then."""
    assert read(NOTHING, 0.5, *[MISS] * 4).distance_m == 0.5
    assert read(NOTHING, 0.5, *[MISS] * 5).distance_m == math.inf
    assert read(NOTHING, 0.5, MISS, 2.0, MISS, 1.8, MISS).distance_m == 1.8


def test_a_sensor_that_misses_half_is_asked_for_twenty() -> None:
    """0.5^20 is below one in a million; the count begins at 5 and grows with what was missed."""
    known = read(NOTHING, *[0.5, MISS] * 300, 0.5)
    assert needed(known, MISS) == 20
    assert read(known, *[MISS] * 20).distance_m == math.inf


def test_a_sensor_that_misses_half_is_believed_sooner_when_it_hears_what_is_behind() -> None:
    """It never heard anything false, less than 1 of 500 by count: (5 over 3) / 500^3 is 8e-8, and two are not enough."""
    known = read(NOTHING, *[0.5, MISS] * 300, 0.5)
    assert needed(known, 2.0) == 5
    assert needed(known, 2.0, MISS) == 5
    assert needed(known, MISS, MISS, MISS, 2.0) == 12
    assert needed(known, 2.0, 2.0, *[MISS] * 30) == 20


def test_what_is_often_heard_too_far_away_is_a_miss_as_much_as_nothing_is() -> None:
    """Half of its readings are too far: 20 of them, as of one that misses half."""
    known = read(NOTHING, *[0.5, 2.0] * 300, 0.5)
    assert needed(known, 2.0) == 20
    assert needed(known, MISS) == 20


def test_a_sensor_that_misses_no_more_is_asked_for_five_again() -> None:
    """What was learned fades: after 3,000 good readings nothing is left of it."""
    cured = read(NOTHING, *[0.5, MISS] * 300, *[0.5] * 3000)
    assert needed(cured, MISS) == 5


def test_a_burst_asks_for_two_more_than_itself() -> None:
    """A burst of four among 400 readings: six."""
    known = read(NOTHING, *[0.5] * 400, *[MISS] * 4, 0.5)
    assert needed(known, MISS) == 6


def test_driving_brings_what_was_missed_nearer() -> None:
    """0.5 m, then 3 misses while the robot drives 0.1 m each: 0.2 m; backing off 0.1 m each: 0.8 m."""
    seen = read(NOTHING, 0.5)
    assert read(seen, *[MISS] * 3, shortened_m=0.1).distance_m == pytest.approx(0.2)
    assert read(seen, *[MISS] * 3, shortened_m=-0.1).distance_m == pytest.approx(0.8)


def test_turning_away_by_more_than_the_cone_frees_the_way() -> None:
    """A cone of 0.26 rad: after 0.2 rad the thing may be in it, after 0.3 it cannot; no reading has to agree."""
    assert read(NOTHING, 0.5, MISS, turned_rad=0.2).distance_m == 0.5
    assert read(read(NOTHING, 0.5), MISS, MISS, turned_rad=0.15).distance_m == math.inf


def test_what_has_left_the_range_is_gone() -> None:
    """3.9 m away, and backed off by 0.2 m: beyond the 4 m of the sensor."""
    assert read(read(NOTHING, 3.9), MISS, shortened_m=-0.2).distance_m == math.inf


def test_the_first_reading_counts_whatever_it_is() -> None:
    """Nothing seen, nothing to hold."""
    assert read(NOTHING, MISS) == NOTHING
    assert read(NOTHING, 0.7).distance_m == 0.7


def test_with_one_and_one_each_reading_is_believed_at_once() -> None:
    """For a sensor that never misses."""
    plain = RangeMemoryParameters(free_readings=1, most_free_readings=1)
    assert needed(read(NOTHING, *[0.5, MISS] * 30, 0.5), MISS, memory=plain) == 1


Missing = Callable[[int, random.Random], float | None]
"""How far too far a reading is (0: right), and None for none, by its number."""

KINDS: dict[str, Missing] = {
    "none": lambda k, chance: 0.0,
    "one in twenty": lambda k, chance: None if chance.random() < 0.05 else 0.0,
    "one in five": lambda k, chance: None if chance.random() < 0.2 else 0.0,
    "one in three": lambda k, chance: None if chance.random() < 0.35 else 0.0,
    "half": lambda k, chance: None if chance.random() < 0.5 else 0.0,
    "every second": lambda k, chance: None if k % 2 else 0.0,
    "the twentieth": lambda k, chance: None if k % 20 == 7 else 0.0,
    "bursts of three": lambda k, chance: None if k % 15 < 3 else 0.0,
    "far spikes": lambda k, chance: chance.uniform(0.1, 3.0) if chance.random() < 0.35 else 0.0,
    "every second too far": lambda k, chance: 1.5 if k % 2 else 0.0,
    "nothing or too far": lambda k, chance: chance.choice([None, 1.0]) if chance.random() < 0.4 else 0.0,
    "bursts of five": lambda k, chance: None if k % 25 < 5 else 0.0,
    "bursts of eight": lambda k, chance: None if k % 30 < 8 else 0.0,
    "all but every sixth": lambda k, chance: None if k % 6 else 0.0,
    "six after two": lambda k, chance: None if k % 8 > 1 else 0.0,
    "bursts of both": lambda k, chance: (None, 1.0, None, 1.5)[k % 15] if k % 15 < 4 else 0.0,
}


class Driven:
    """A robot of one wheel with a sensor at its nose, driven at a wall; it brakes as the guard counts on."""

    def __init__(self, missing: Missing, seed: int, *, wall_m: float = 1.2, cycle_s: float = 0.05) -> None:
        self._missing, self._chance, self._wall_m, self._cycle_s = (
            missing,
            random.Random(seed),
            wall_m,
            cycle_s,
        )
        self.x_m = self.speed_m_s = self.now_s = 0.0
        self.beams: Beams = from_mounts(FRONT)

    def moved(self, wheels_rad: tuple[float, ...]) -> tuple[float, float]:
        """A wheel whose angle is the way."""
        return self.x_m - wheels_rad[0], 0.0

    def step(self, number: int, asked_m_s: float) -> None:
        """A cycle: a reading in whole centimetres, what the guard allows, and the way of it."""
        too_far_m = self._missing(number, self._chance)
        status, range_m = RangeStatus.NO_ECHO, None
        if too_far_m is not None:
            status, range_m = RangeStatus.OK, math.floor(100 * (self._wall_m - self.x_m + too_far_m)) / 100
        measured = RangeMeasured(self.now_s, self.now_s, "front", status, range_m, 0.02, 4.0, 0.26)
        self.beams = guard.update(PARAMETERS, self.beams, measured, (self.x_m,), self.now_s, self.moved)
        motion, _ = guard.limit(PARAMETERS, self.beams, Twist2D(asked_m_s, 0.0), self.now_s, moved=self.moved)
        assert isinstance(motion, Twist2D)
        step_m_s = PARAMETERS.deceleration_m_s2 * self._cycle_s
        self.speed_m_s += max(-step_m_s, min(step_m_s, motion.linear_m_s - self.speed_m_s))
        self.x_m += self.speed_m_s * self._cycle_s
        self.now_s += self._cycle_s


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("speed_m_s", [0.1, 0.2, 0.4])
def test_no_contact_and_no_creeping(kind: str, speed_m_s: float) -> None:
    """Each kind of misses, ten seeds: it stands before the wall, and is moved by nothing in 40 s of asking."""
    for seed in range(10):
        robot = Driven(KINDS[kind], seed)
        for number in range(600):
            robot.step(number, speed_m_s)
        stood_m = robot.x_m
        for number in range(600, 1400):
            robot.step(number, speed_m_s)
        assert robot.x_m == stood_m, (kind, seed)
        assert 0.12 <= 1.2 - robot.x_m <= 0.20, (kind, seed)


@pytest.mark.parametrize(("silent_s", "allowed"), [(0.4, True), (0.6, False)])  # max_age_s is 0.5
def test_a_silent_sensor_still_sees_what_it_saw(silent_s: float, allowed: bool) -> None:
    """At a wall the silence of the board for a second, or an unplugged sensor, frees nothing; turning away does."""
    beams = from_mounts(FRONT)
    seen = RangeMeasured(10.0, 10.0, "front", RangeStatus.OK, 0.16, 0.02, 4.0, 0.26)
    beams = guard.update(PARAMETERS, beams, seen, (0.0,), 10.0, lambda wheels: (0.0, 0.0))
    for turned_rad, speed in ((0.0, 0.1), (0.3, 0.3)):
        moved = (lambda turned: lambda wheels: (0.0, turned))(turned_rad)
        motion, _ = guard.limit(PARAMETERS, beams, Twist2D(0.3, 0.0), 10.0 + silent_s, moved=moved)
        assert isinstance(motion, Twist2D)
        assert motion.linear_m_s <= (speed if turned_rad == 0 or allowed else 0.3)
        assert (motion.linear_m_s == 0.3) == (turned_rad > 0 and not allowed)


def test_a_sensor_that_hears_no_echo_is_silent() -> None:
    """``silent_is_obstacle``: unplugged it says "no echo" for ever; 0.5 s of it are an obstacle, too far is not."""
    strict = PARAMETERS.model_copy(update={"silent_is_obstacle": True})
    for status, expected in ((RangeStatus.NO_ECHO, 0.0), (RangeStatus.TOO_FAR, 0.3)):
        beams = from_mounts(FRONT)
        for number in range(20):
            at_s = 10.0 + 0.05 * number
            measured = RangeMeasured(at_s, at_s, "front", status, None, 0.02, 4.0, 0.26)
            beams = guard.update(strict, beams, measured)
        motion, _ = guard.limit(strict, beams, Twist2D(0.3, 0.0), 10.95)
        assert isinstance(motion, Twist2D)
        assert motion.linear_m_s == expected


def test_a_sonar_that_spikes_for_three_readings_while_the_motors_run() -> None:
    """As an XRP robot's 0.3 m before a thing: three readings 0.2 m too far, or too near, then right again."""
    assert read(NOTHING, 0.3, 0.5, 0.5, 0.5, 0.3).distance_m == 0.3
    near = read(NOTHING, 0.3, 0.1, 0.1, 0.1)
    assert near.distance_m == 0.1  # it may be true, so it is believed,
    assert read(near, *[0.3] * 5).distance_m == 0.3  # until five readings agree


def test_a_sonar_that_hears_ghosts_in_a_free_room_holds_nobody() -> None:
    """What a NewPing user printed with nothing in front: nothing nearer than was read, so room for 0.9 m/s at least."""
    centimetres = (
        144,
        0,
        0,
        0,
        105,
        105,
        94,
        0,
        378,
        0,
        0,
        0,
        0,
        0,
        0,
        106,
        106,
        0,
        0,
        0,
        106,
        250,
        0,
        108,
        0,
        108,
        0,
    )
    believed = NOTHING
    for reading in centimetres:
        believed = read(believed, reading / 100 if reading else MISS)
        assert believed.distance_m >= 0.94


def test_a_sonar_that_says_zero_every_fifty_milliseconds() -> None:
    """A VEX sensor on PROS: every second reading is none; the thing stays where it is."""
    believed = NOTHING
    for number in range(200):
        believed = read(believed, 0.42 if number % 2 else MISS)
        assert number == 0 or believed.distance_m == 0.42


def test_a_sonar_on_a_pi_zero_that_answers_each_third_time() -> None:
    """What its user printed 8.5 cm before a thing, 0 for "Retrying!": up to five in a row, and once 3.1 cm.

    The first time through, the burst of five may free the way; from then on the thing stays.
    """
    printed = "0 8.6 8.5 0 0 0 0 0 8.5 0 0 0 0 3.1 0 0 8.5 0 7.6 0 0 0 0 8.5 8.9 0 0 0 7.3 8.5 0 0 0"
    readings = [float(word) / 100 or MISS for word in printed.split()]
    believed = read(NOTHING, *readings)
    for reading in readings * 10:
        believed = read(believed, reading)
        assert believed.distance_m <= 0.09


def test_a_sensor_with_false_near_readings_lets_the_robot_drive_on() -> None:
    """One reading in 25 claims something near in a free way: each is gone after five others, and none teaches misses.

    So a false reading holds the robot for 5 readings of 25 and less, where one of 30 at most would hold it for ever.
    """
    choose, believed, held = random.Random(1), NOTHING, 0
    for _ in range(5000):
        believed = read(believed, 0.3 if choose.random() < 0.04 else MISS)
        held += believed.distance_m < math.inf
    assert held < 0.25 * 5000


def test_a_thing_that_was_shown_often_is_held_by_what_was_learned() -> None:
    """A sensor that is known to miss half is asked for 17 readings; of a thing that it showed once, for twice five."""
    sensor = read(NOTHING, *(0.5, MISS) * 40)
    moved_off = read(sensor, *(MISS,) * 60)
    assert moved_off.distance_m == math.inf
    assert needed(read(moved_off, 0.5), MISS) == 2 * MEMORY.free_readings
    assert needed(read(moved_off, *(0.5,) * 4), MISS) == 17


def test_what_was_given_up_and_is_seen_again_in_its_place_was_missed() -> None:
    """Of a wall 8 readings in a row miss: after the fifth it was given up; the next time it is held through 8."""
    wall = read(NOTHING, *[0.5] * 20)
    assert read(wall, *[MISS] * 8).distance_m == math.inf
    again = read(wall, *[MISS] * 8, 0.5)
    assert needed(again, MISS) == 10
    assert needed(read(wall, *[MISS] * 8, 0.9), 0.9, 0.9, MISS) == 100  # another thing teaches nothing of it


def test_what_was_given_up_is_looked_for_where_the_robot_has_brought_it() -> None:
    """0.5 m, and 8 misses of 1 cm each: it would be 0.42 m away, so 0.42 is it, and 0.3 is something else."""
    wall = read(read(NOTHING, *[0.5] * 20), *[MISS] * 8, shortened_m=0.01)
    assert read(wall, 0.42).longest == 8
    assert read(wall, 0.3).longest == 0


def test_what_was_given_up_is_forgotten_in_the_end() -> None:
    """Each miss is evidence against it: after 40 a thing in its place is a new one."""
    gone = read(read(NOTHING, *[0.5] * 20), *[MISS] * 40)
    assert gone.gone_m == math.inf
    assert read(gone, 0.5).longest == 0


def test_what_was_given_up_is_not_looked_for_where_the_robot_has_turned_to() -> None:
    """After 0.3 rad, with a cone of 0.26, a thing as far away is another one."""
    turned = read(read(NOTHING, *[0.5] * 20), *[MISS] * 6)
    assert read(read(turned, MISS, turned_rad=0.3), 0.5).longest == 0
    assert read(read(turned, MISS, turned_rad=0.2), 0.5).longest == 7
