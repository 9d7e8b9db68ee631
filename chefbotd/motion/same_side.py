"""Wheels of one side that disagree (slip, a broken encoder): which of them to believe.

The wheels of a side roll over the same ground at the same speed. Their recent travel is compared; "recent" fades with a
time constant. Where they disagree, the wheel nearest to the expected travel is believed. Wheels far from that one are
excluded until they agree again. The expected travel is:

- with three or more wheels: their median, because one cannot outvote two;
- with two that are not driven: the larger travel, because only the ground can have turned that wheel;
- with two that are driven, one of which stands: the moving wheel's, whatever was commanded. Counts do not come from
  nothing, and a wheel that is controlled by an encoder stuck at zero runs away;
- with two that are driven and both move: the commanded travel, times the share of its own command that the other side
  achieves, because a robot that is held back is slow on both sides. A side that sticks says nothing about this one.

Whether a wheel stands is decided from a second, faster-fading record, so the choice follows the wheels and not itself.

Wheels that are commanded to different speeds (``set_wheel_velocities``) are not compared.
"""

import math
from collections.abc import Iterable, Sequence
from statistics import median
from typing import TypeVar

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace
from chefbotd.motion.kinematics import Kinematics, without


class SameSideParameters(Parameters):
    """Wheels disagree if they differ by more than ``tolerance_m``, two counts, and ``share`` of their recent travel.

    ``memory_s`` is the time constant with which recent travel fades. An excluded wheel is believed again once it is
    within half of that difference.
    """

    memory_s: float = Field(default=0.2, gt=0, le=10)
    tolerance_m: float = Field(default=0.0015, gt=0, le=1)
    share: float = Field(default=0.1, gt=0, lt=1)
    """Wheels of a side disagree if they differ by more than this share of their recent travel, and
    ``tolerance_m``."""


LEAST_PACE, MOST_PACE = 0.25, 1.5
"""A side that achieves less than LEAST_PACE of its command sticks; more than MOST_PACE is never expected."""

LATEST = 4.0
"""How many times faster the record fades that decides whether a wheel stands."""

STANDS_SHARE = 0.1
"""A wheel stands if it rolls less than this share of the other wheel of its side, or no more than two counts."""


class SameSideState(Record, frozen=True):
    """Recent travel of each wheel, and what was commanded; ``latest_m`` fades faster and adds up both directions.

    ``substitutes`` are pairs of indices: a wheel that is not believed, and the one of its side that is.
    """

    rolled_m: tuple[float, ...]
    latest_m: tuple[float, ...]
    asked_m: tuple[float, ...]
    substitutes: tuple[tuple[int, int], ...] = ()

    @property
    def excluded(self) -> tuple[int, ...]:
        """The indices of the wheels that are not believed."""
        return tuple([wheel for wheel, _ in self.substitutes]) if self.substitutes else ()


class SameSideWheels:
    """Compares the wheels of each side; where there is one a side, there is nothing to compare."""

    def __init__(self, params: SameSideParameters, kinematics: Kinematics, counts_per_turn: float) -> None:
        self._params, self._kinematics = params, kinematics
        self._two_counts_m = 2 * max(kinematics.radii_m) * math.tau / counts_per_turn
        self._tolerance_m = params.tolerance_m + self._two_counts_m
        self._sides = (kinematics.left, kinematics.right), (kinematics.right, kinematics.left)
        self._any = max(len(kinematics.left), len(kinematics.right)) > 1
        nothing = (0.0,) * len(kinematics.radii_m)
        self.start = SameSideState(nothing, nothing, nothing)

    def compare(
        self, state: SameSideState, travel_rad: Sequence[float], setpoint_m_s: Sequence[float], dt_s: float
    ) -> SameSideState:
        """The next state: the wheels turned by ``travel_rad`` in ``dt_s``, commanded to these rim speeds."""
        if not self._any:
            return state
        kept = math.exp(-max(dt_s, 0.0) / self._params.memory_s)
        turned = zip(travel_rad, self._kinematics.radii_m, strict=True)
        travel_m = [angle * radius for angle, radius in turned]
        now = SameSideState(
            _fade_record(state.rolled_m, kept, travel_m),
            _fade_record(state.latest_m, kept**LATEST, map(abs, travel_m)),
            _fade_record(state.asked_m, kept, [speed * dt_s for speed in setpoint_m_s]),
            state.substitutes,
        )
        outliers = [pair for side, other in self._sides for pair in self._outliers(now, side, other)]
        return replace(now, substitutes=tuple(outliers))

    def credit(self, state: SameSideState, effort: tuple[float, ...]) -> tuple[float, ...]:
        """Each wheel's effort, -1 to 1; at least 0.5 where excluded: its substitute turned with that effort."""
        if not state.substitutes:
            return effort
        out = state.excluded
        return tuple(
            [math.copysign(max(abs(e), 0.5), e) if e and i in out else e for i, e in enumerate(effort)]
        )

    def _outliers(
        self, state: SameSideState, side: tuple[int, ...], other: tuple[int, ...]
    ) -> list[tuple[int, int]]:
        """The wheels of a side that are far from the believed one, each with that one."""
        rolled_m = [state.rolled_m[i] for i in side]
        if max(rolled_m) - min(rolled_m) <= self._tolerance_m / 2:
            return []  # the usual case: no wheel is far from any other
        believed = self._believed(state, side, other)
        if believed is None:
            return []
        return [(i, believed) for i in side if self._is_apart(state, i, state.rolled_m[believed])]

    def _believed(self, state: SameSideState, side: tuple[int, ...], other: tuple[int, ...]) -> int | None:
        """The wheel nearest to what is expected of its side; None where there is nothing to compare."""
        asked_m = [state.asked_m[i] for i in side]
        if len(side) < 2 or max(asked_m) - min(asked_m) > self._tolerance_m:
            return None
        if len(side) == 2:
            slower, faster = sorted(side, key=lambda i: state.latest_m[i])
            if self._stands(state, slower, faster):
                return faster
            substitutes = [substitute for _, substitute in state.substitutes if substitute in side]
            if substitutes and state.latest_m[faster] <= self._two_counts_m:
                return substitutes[0]  # nothing moves: keep the last choice
            if abs(asked_m[0]) <= self._tolerance_m:
                return max(side, key=lambda i: abs(state.rolled_m[i]))
            expected_m = asked_m[0] * self._pace(state, other)
        else:
            expected_m = median([state.rolled_m[i] for i in side])
        return min(side, key=lambda i: abs(state.rolled_m[i] - expected_m))

    def _stands(self, state: SameSideState, slower: int, faster: int) -> bool:
        """Whether the slower of two wheels stands while the faster one rolls."""
        slower_m, faster_m = state.latest_m[slower], state.latest_m[faster]
        return slower_m <= max(STANDS_SHARE * faster_m, self._two_counts_m) < faster_m

    def _pace(self, state: SameSideState, side: tuple[int, ...]) -> float:
        """The share of its command that a side achieves, by its best believed wheel."""
        ratios = [
            state.rolled_m[i] / state.asked_m[i]
            for i in without(side, state.excluded)
            if abs(state.asked_m[i]) > self._tolerance_m
        ]
        best = min(ratios, key=lambda ratio: abs(ratio - 1.0), default=1.0)
        return min(best, MOST_PACE) if best >= LEAST_PACE else 1.0

    def _is_apart(self, state: SameSideState, wheel: int, reach_m: float) -> bool:
        rolled_m = state.rolled_m[wheel]
        tolerance_m = self._tolerance_m + self._params.share * max(abs(reach_m), abs(rolled_m))
        return abs(rolled_m - reach_m) > (tolerance_m / 2 if wheel in state.excluded else tolerance_m)


def _fade_record(lately: Sequence[float], kept: float, newly: Iterable[float]) -> tuple[float, ...]:
    """A record that has faded to the share ``kept``, plus new travel."""
    return tuple([kept * old + new for old, new in zip(lately, newly, strict=True)])


T = TypeVar("T")

Substitutes = Sequence[tuple[int, int]]
"""Pairs of indices: a wheel that is not believed, and its substitute."""


def substitute_readings(substitutes: Substitutes, values: Sequence[T]) -> tuple[T, ...]:
    """One value per wheel; a wheel that is not believed has its substitute's."""
    replaced = list(values)
    for wheel, substitute in substitutes:
        replaced[wheel] = values[substitute]
    return tuple(replaced)


def loop_speeds(
    substitutes: Substitutes, speeds_m_s: Sequence[float], setpoints_m_s: Sequence[float]
) -> tuple[float, ...]:
    """The rim speed in m/s that each wheel's controller uses."""
    believed_m_s = list(speeds_m_s)
    for wheel, substitute in substitutes:
        setpoint_m_s = setpoints_m_s[substitute]
        faster = max if setpoint_m_s >= 0 else min
        slower = min if setpoint_m_s >= 0 else max
        believed_m_s[substitute] = faster(believed_m_s[substitute], slower(speeds_m_s[wheel], setpoint_m_s))
    return substitute_readings(substitutes, believed_m_s)
