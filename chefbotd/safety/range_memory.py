"""What a range sensor is believed to see: a reading without an echo, or one too far, between good ones is a miss.

An ultrasonic echo is lost on cloth, at a slant, or by chance; an infrared sensor glitches. So what was seen stays where
it was, while the robot's own motion brings it nearer or farther, until

- so many readings in a row do not show it that they cannot all be misses: then the nearest of them counts; or
- the robot has turned away from it by more than the sensor's cone, or moved beyond the sensor's range from it.

How many readings that takes depends on the sensor. Its share of misses is learned from readings that did not show a
thing which the next ones showed again; with a share p, n misses in a row happen with probability p^n, which must be
below ``CHANCE``. Readings of something farther away are counted by themselves, too: with a share q of those, m of them
among n happen with less than (n over m) q^m. So a sensor that often hears nothing, and never anything false, is believed
soon when it hears what is behind a thing that was taken away.

A nearer reading is believed at once. It may be a false one, such as a line with a digit too few, of which nothing may be
learned: a false reading in 25 would look like a thing that is missed 24 times. So readings are evidence for a thing
(Wald's sequential test of ``SEEN_SHARE`` against ``FALSE_SHARE``), and misses are learned of one that is sure. What was
given up and is seen again in its place was missed meanwhile: its evidence goes on.
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

SEEN_SHARE, FALSE_SHARE = 0.25, 0.04
"""The least share of readings that shows a thing, and the largest share of false ones that claims one."""

SHOWN, MISSED = math.log(SEEN_SHARE / FALSE_SHARE), math.log((1 - SEEN_SHARE) / (1 - FALSE_SHARE))
"""How much more likely a thing is after a reading that shows it, and after one that does not (logarithms)."""

SURE, SUREST = 7.3, 9.0
"""Evidence of a thing that is there: four readings in a row. Of things that false readings claim few get there."""

UNSURE_FACTOR = 2
"""Of what is not sure at most so many times the fewest readings are asked for."""

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
    ``evidence`` is that the thing was there when last shown. What was given up is remembered with the same fields,
    as ``gone_``, until the misses since have used up its evidence.
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
    evidence: float = 0.0
    gone_m: float = math.inf
    gone_run: int = 0
    gone_run_farther: int = 0
    gone_turned_rad: float = 0.0
    gone_evidence: float = 0.0


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
    if before.gone_m != math.inf:
        gone_m = before.gone_m - shortened_m
        if abs(distance_m - gone_m) <= _alike_m(gone_m, stand_m, hysteresis_m):
            return _confirm(_take_back(before), distance_m, is_sure=False)
        before = _follow_gone(
            before, distance_m, gone_m, before.gone_turned_rad + turned_rad, field_of_view_rad
        )
    expected_m = before.distance_m - shortened_m
    near_m = expected_m + hysteresis_m + ROUNDING_M  # most readings: these ask for no more
    if distance_m <= near_m or distance_m <= expected_m + _alike_m(expected_m, stand_m, hysteresis_m):
        return _confirm(before, distance_m, is_sure=before.evidence >= SURE)
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
    if abs(missing.turned_rad) > field_of_view_rad or missing.distance_m > max_range_m:
        return _begin(missing, missing.nearest_m)
    if missing.run >= readings_needed(params, before) or _is_behind_seen(params, missing):
        return _give_up(missing)
    return missing


def _alike_m(expected_m: float, stand_m: float, hysteresis_m: float) -> float:
    """How much farther a reading of the same thing may be."""
    beyond_m = expected_m - stand_m
    return hysteresis_m + ROUNDING_M + (FARTHER_SHARE * beyond_m if beyond_m > 0 else 0.0)


def _begin(before: Believed, distance_m: float) -> Believed:
    """Something is seen for the first time, or nothing; what was learned of the sensor stays."""
    return Believed(
        distance_m,
        shown=before.shown,
        missed=before.missed,
        longest=before.longest,
        farther=before.farther,
        longest_farther=before.longest_farther,
        evidence=0.0 if distance_m == math.inf else SHOWN,
    )


def _give_up(missing: Believed) -> Believed:
    """The nearest of the readings that did not show a thing counts; the thing may be seen again where it was."""
    return replace(
        _begin(missing, missing.nearest_m),
        gone_m=missing.distance_m,
        gone_run=missing.run,
        gone_run_farther=missing.run_farther,
        gone_turned_rad=missing.turned_rad,
        gone_evidence=missing.evidence,
    )


def _take_back(before: Believed) -> Believed:
    """What was given up is seen again where it would be: all since were misses."""
    return replace(
        _begin(before, before.gone_m),
        run=before.gone_run,
        run_farther=before.gone_run_farther,
        evidence=before.gone_evidence,
    )


def _follow_gone(
    before: Believed, distance_m: float, gone_m: float, turned_rad: float, field_of_view_rad: float
) -> Believed:
    """What was given up would be ``gone_m`` away, and was not shown by this reading either."""
    run = before.gone_run + 1
    if gone_m <= 0 or abs(turned_rad) > field_of_view_rad or before.gone_evidence + run * MISSED <= 0:
        return replace(before, gone_m=math.inf)
    return replace(
        before,
        gone_m=gone_m,
        gone_run=run,
        gone_run_farther=before.gone_run_farther + (distance_m != math.inf),
        gone_turned_rad=turned_rad,
    )


def _confirm(before: Believed, distance_m: float, *, is_sure: bool) -> Believed:
    """Something is where it was believed to be, or nearer: what did not show it was a miss.

    That is learned of what ``is_sure``, or is so by this reading.
    """
    if before.distance_m == math.inf:
        return before if distance_m == math.inf else replace(before, distance_m=distance_m, evidence=SHOWN)
    evidence = before.evidence + before.run * MISSED + SHOWN
    evidence = SUREST if evidence > SUREST else SHOWN if evidence < SHOWN else evidence
    if not is_sure and evidence < SURE:
        return replace(_begin(before, distance_m), evidence=evidence)
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
        evidence=evidence,
    )


def readings_needed(params: RangeMemoryParameters, believed: Believed) -> int:
    """How many readings in a row must not show a thing until it is gone."""
    needed = math.ceil(math.log(CHANCE) / math.log(_share(believed, believed.missed)))
    needed = max(needed, math.ceil(believed.longest) + BEYOND_LONGEST, params.free_readings)
    most = params.most_free_readings if believed.evidence >= SURE else UNSURE_FACTOR * params.free_readings
    return min(needed, most, params.most_free_readings)


def _share(believed: Believed, count: float) -> float:
    return (count + FIRST_SHARE * FIRST_READINGS) / (believed.shown + believed.missed + FIRST_READINGS)


def _is_behind_seen(params: RangeMemoryParameters, believed: Believed) -> bool:
    """Whether so many readings of a run show something farther that they cannot all be false: the thing is gone."""
    run, farther = believed.run, believed.run_farther
    if run < params.free_readings or farther < math.ceil(believed.longest_farther) + BEYOND_LONGEST:
        return False
    return math.comb(run, farther) * _share(believed, believed.farther) ** farther <= CHANCE
