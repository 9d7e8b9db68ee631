"""What a range sensor is believed to see: a reading without an echo, or one too far, between good ones is a miss.

An ultrasonic echo is lost on cloth, at a slant, or by chance; an infrared sensor glitches. So what was seen stays where
it was, while the robot's own motion brings it nearer or farther, until

- so many readings in a row do not show it that they cannot all be misses: then the nearest of them counts; or
- the robot has turned away from it by more than the sensor's cone, or moved beyond the sensor's range from it.

How many readings that takes depends on the sensor. Its share of misses is learned from readings that did not show a
thing which the next ones showed again; with a share p, n misses in a row happen with probability p^n, which must be
below ``CHANCE``. Readings of something farther away are counted by themselves, too: with a share q of those, m of them
among n happen with less than (n over m) q^m. So a sensor that often hears nothing, and never anything false, is believed
soon when it hears what is behind a thing that was taken away. A nearer reading is believed at once. Until three others
have shown the same it may be a false one, such as a line with a digit too many: then nothing is learned of misses, and
the fewest readings without it are enough.
"""

import math

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace

CHANCE = 1e-6
"""One run of misses in a million readings, 14 hours at 20 a second, is taken for a free way."""

FIRST_SHARE, FIRST_READINGS = 0.05, 10.0
"""Until a sensor is known it is taken for one that misses one reading in twenty; ten readings weigh as much as that."""

FORGET_SHARE = 1 / 400
"""Each judged reading takes this share of what was learned before it: after 20 s at 20 a second a third is left."""

BEYOND_LONGEST = 2
"""Misses that come in bursts are no chance: so many more readings than the longest burst are asked for."""

SURE = 3
"""A thing that so many further readings have shown is there: one false reading in 25 makes few that are."""

ROUNDING_M = 1e-9
"""The last bit of a sum is not a step of the sensor."""

FARTHER_SHARE = 0.05
"""How much farther a reading of the same thing may be, of what is beyond the place where the robot stands."""


class RangeMemoryParameters(Parameters):
    """An obstacle goes after ``free_readings`` readings in a row without it, and after ``most_free_readings`` at most.

    In between it depends on how often the sensor misses. With 1 and 1 every reading is believed at once.
    """

    free_readings: int = Field(default=5, ge=1, le=100)
    most_free_readings: int = Field(default=30, ge=1, le=1000)


class Believed(Record, frozen=True):
    """What is believed, and what speaks against it.

    ``distance_m`` (infinity: a free way) is as of the last reading. ``run`` readings in a row did not show it,
    ``run_farther`` of them showed something farther, and the nearest was ``nearest_m``; since it was seen the robot has
    turned by ``turned_rad``. ``shown``, ``missed`` and, of the latter, ``farther`` count what the sensor did where a
    thing was, and fade; ``longest`` is its longest burst of misses, ``longest_farther`` the most farther ones in one.
    ``confirmed``: so many further readings have shown it, ``SURE`` at most.
    """

    distance_m: float = math.inf
    run: int = 0
    nearest_m: float = math.inf
    turned_rad: float = 0.0
    shown: float = 0.0
    missed: float = 0.0
    longest: float = 0.0
    run_farther: int = 0
    farther: float = 0.0
    longest_farther: float = 0.0
    confirmed: int = 0


NOTHING = Believed()
"""Of a sensor that was never heard: nothing is in its way."""


def add_reading(
    params: RangeMemoryParameters,
    before: Believed,
    distance_m: float,
    shortened_m: float,
    turned_rad: float,
    *,
    stand_m: float,
    hysteresis_m: float,
    max_range_m: float,
    field_of_view_rad: float,
) -> Believed:
    """What is believed after a reading (infinity: nothing in range).

    Since the reading before, the robot's motion has shortened the beam by ``shortened_m`` and turned it by
    ``turned_rad``. A thing is still the same one where it reads farther by ``hysteresis_m``, and a little more beyond
    ``stand_m``, the distance for which the robot stands.
    """
    expected_m = before.distance_m - shortened_m
    beyond_m = expected_m - stand_m
    alike_m = hysteresis_m + FARTHER_SHARE * beyond_m if beyond_m > 0 else hysteresis_m
    if distance_m <= expected_m + alike_m + ROUNDING_M:
        return _confirm(before, distance_m)
    if expected_m < 0:
        expected_m = 0.0
    missing = replace(
        before,
        distance_m=expected_m,
        run=before.run + 1,
        run_farther=before.run_farther + (distance_m != math.inf),
        nearest_m=min(before.nearest_m - shortened_m, distance_m),
        turned_rad=before.turned_rad + turned_rad,
    )
    if (
        missing.run >= readings_needed(params, before)
        or _is_behind_seen(params, missing)
        or abs(missing.turned_rad) > field_of_view_rad
        or missing.distance_m > max_range_m
    ):
        return _begin_run(missing, missing.nearest_m)
    return missing


def _confirm(before: Believed, distance_m: float) -> Believed:
    """Something is where it was believed to be, or nearer: what did not show it was a miss."""
    if before.distance_m == math.inf:
        return before if distance_m == math.inf else replace(before, distance_m=distance_m)
    if before.confirmed < SURE:
        return _begin_run(before, distance_m, before.confirmed + 1)
    keep = 1 - FORGET_SHARE
    longest, longest_farther = before.longest * keep, before.longest_farther * keep
    return Believed(
        distance_m,
        shown=before.shown * keep + 1,
        missed=before.missed * keep + before.run,
        longest=longest if longest > before.run else float(before.run),
        farther=before.farther * keep + before.run_farther,
        longest_farther=longest_farther
        if longest_farther > before.run_farther
        else float(before.run_farther),
        confirmed=SURE,
    )


def _begin_run(before: Believed, distance_m: float, confirmed: int = 0) -> Believed:
    """Something is seen here that so many further readings have shown."""
    return replace(
        before,
        distance_m=distance_m,
        run=0,
        run_farther=0,
        nearest_m=math.inf,
        turned_rad=0.0,
        confirmed=confirmed,
    )


def readings_needed(params: RangeMemoryParameters, believed: Believed) -> int:
    """How many readings in a row must not show a thing until it is gone."""
    if believed.confirmed < SURE:
        return params.free_readings
    needed = math.ceil(math.log(CHANCE) / math.log(_share(believed, believed.missed)))
    needed = max(needed, math.ceil(believed.longest) + BEYOND_LONGEST, params.free_readings)
    return min(needed, params.most_free_readings)


def _share(believed: Believed, count: float) -> float:
    return (count + FIRST_SHARE * FIRST_READINGS) / (believed.shown + believed.missed + FIRST_READINGS)


def _is_behind_seen(params: RangeMemoryParameters, believed: Believed) -> bool:
    """Whether so many readings of a run show something farther that they cannot all be false: the thing is gone."""
    run, farther = believed.run, believed.run_farther
    if run < params.free_readings or farther < math.ceil(believed.longest_farther) + BEYOND_LONGEST:
        return False
    return math.comb(run, farther) * _share(believed, believed.farther) ** farther <= CHANCE
