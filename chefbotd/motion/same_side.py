"""Wheels on the same side that disagree (slip, a broken encoder): which of them to believe.

Mates roll over the same ground at the same speed. What each has rolled lately is compared, in a memory that fades.
Where they disagree, the one nearest to what is expected is believed, and whoever is far from it is left out until it
agrees again. What is expected:

- of three or more mates their median, since one cannot outvote two;
- of two that are not driven, the farther one: only the ground can have turned it;
- of two that are driven and of which one stands, the one that moves, whatever was expected: counts do not come from
  nothing, and a wheel that is controlled by an encoder that stays at zero runs away;
- of two that are driven and both move, what they were asked for, as far as the other side does what it is asked for: a
  robot that is held back is slow on both sides. A side that sticks tells nothing of this one.

Who stands is seen in a memory of its own, which fades faster, so that the choice follows the wheels and not itself.

Mates that are asked for different speeds (``set_wheel_velocities``) are not compared.
"""

import math
from collections.abc import Iterable, Sequence
from statistics import median

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace
from chefbotd.motion.kinematics import Kinematics, without


class SameSideParameters(Parameters):
    """When mates disagree: by more than ``slack_m``, two counts, and ``share`` of what they have rolled lately.

    ``memory_s`` is how long "lately" is: the time constant with which travel is forgotten. A wheel that is left out
    comes back once it is within half of that.
    """

    memory_s: float = Field(default=0.2, gt=0, le=10)
    slack_m: float = Field(default=0.0015, gt=0, le=1)
    share: float = Field(default=0.1, gt=0, lt=1)


LEAST_PACE, MOST_PACE = 0.25, 1.5
"""The other side sticks when it does less of its command than this; and more than that is not expected of this one."""

LATEST = 4.0
"""So many times faster than what was rolled lately is what was rolled just now forgotten."""

STANDS_SHARE = 0.1
"""A wheel stands that rolls less than this share of what its mate does, or no more than two counts."""


class MatesState(Record, frozen=True):
    """What each wheel has rolled lately, and was asked to; ``latest_m`` is its way just now, to and fro taken together.

    ``led`` are the wheels that are not believed, each with the mate that is: pairs of indices.
    """

    rolled_m: tuple[float, ...]
    latest_m: tuple[float, ...]
    asked_m: tuple[float, ...]
    led: tuple[tuple[int, int], ...] = ()

    @property
    def excluded(self) -> tuple[int, ...]:
        """The indices of the wheels that are not believed."""
        return tuple([wheel for wheel, _ in self.led])


class Mates:
    """Compares the wheels of each side; where there is one a side, there is nothing to compare."""

    def __init__(self, params: SameSideParameters, kinematics: Kinematics, counts_per_turn: float) -> None:
        self._params, self._kinematics = params, kinematics
        self._two_counts_m = 2 * max(kinematics.radii_m) * math.tau / counts_per_turn
        self._slack_m = params.slack_m + self._two_counts_m
        self._sides = (kinematics.left, kinematics.right), (kinematics.right, kinematics.left)
        self._any = max(len(kinematics.left), len(kinematics.right)) > 1
        nothing = (0.0,) * len(kinematics.radii_m)
        self.start = MatesState(nothing, nothing, nothing)

    def compare(
        self, state: MatesState, travel_rad: Sequence[float], setpoint_m_s: Sequence[float], dt_s: float
    ) -> MatesState:
        """The wheels turned so far in ``dt_s``, in which they were asked for these rim speeds."""
        if not self._any:
            return state
        kept = math.exp(-max(dt_s, 0.0) / self._params.memory_s)
        turned = zip(travel_rad, self._kinematics.radii_m, strict=True)
        travel_m = [angle * radius for angle, radius in turned]
        now = MatesState(
            _faded(state.rolled_m, kept, travel_m),
            _faded(state.latest_m, kept**LATEST, map(abs, travel_m)),
            _faded(state.asked_m, kept, [speed * dt_s for speed in setpoint_m_s]),
            state.led,
        )
        led = [pair for side, other in self._sides for pair in self._strays(now, side, other)]
        return replace(now, led=tuple(led))

    def credit(self, state: MatesState, effort: tuple[float, ...]) -> tuple[float, ...]:
        """The wheels' effort, -1 to 1; at least a half for those left out: small as it was, their mates turned by it."""
        if not state.led:
            return effort
        out = state.excluded
        return tuple(
            [math.copysign(max(abs(e), 0.5), e) if e and i in out else e for i, e in enumerate(effort)]
        )

    def _strays(
        self, state: MatesState, side: tuple[int, ...], other: tuple[int, ...]
    ) -> list[tuple[int, int]]:
        """The wheels of a side that are far from the one to believe, each with that one."""
        rolled_m = [state.rolled_m[i] for i in side]
        if max(rolled_m) - min(rolled_m) <= self._slack_m / 2:
            return []  # the usual case, and whoever was believed, nobody could be far from them
        believed = self._believed(state, side, other)
        if believed is None:
            return []
        return [(i, believed) for i in side if self._is_apart(state, i, state.rolled_m[believed])]

    def _believed(self, state: MatesState, side: tuple[int, ...], other: tuple[int, ...]) -> int | None:
        """The wheel nearest to what is expected of its side; None where there is nothing to compare."""
        asked_m = [state.asked_m[i] for i in side]
        if len(side) < 2 or max(asked_m) - min(asked_m) > self._slack_m:
            return None
        if len(side) == 2:
            slower, faster = sorted(side, key=lambda i: state.latest_m[i])
            if self._stands(state, slower, faster):
                return faster
            leaders = [leader for _, leader in state.led if leader in side]
            if leaders and state.latest_m[faster] <= self._two_counts_m:
                return leaders[0]  # nobody moves, so there is nothing new to go by
            if abs(asked_m[0]) <= self._slack_m:
                return max(side, key=lambda i: abs(state.rolled_m[i]))
            expected_m = asked_m[0] * self._pace(state, other)
        else:
            expected_m = median([state.rolled_m[i] for i in side])
        return min(side, key=lambda i: abs(state.rolled_m[i] - expected_m))

    def _stands(self, state: MatesState, slower: int, faster: int) -> bool:
        """Whether the slower one of two stands while the faster one rolls, just now."""
        slower_m, faster_m = state.latest_m[slower], state.latest_m[faster]
        return slower_m <= max(STANDS_SHARE * faster_m, self._two_counts_m) < faster_m

    def _pace(self, state: MatesState, side: tuple[int, ...]) -> float:
        """How much of what it was asked for a side does: its best wheel, of those believed so far."""
        ratios = [
            state.rolled_m[i] / state.asked_m[i]
            for i in without(side, state.excluded)
            if abs(state.asked_m[i]) > self._slack_m
        ]
        best = min(ratios, key=lambda ratio: abs(ratio - 1.0), default=1.0)
        return min(best, MOST_PACE) if best >= LEAST_PACE else 1.0

    def _is_apart(self, state: MatesState, wheel: int, reach_m: float) -> bool:
        rolled_m = state.rolled_m[wheel]
        tolerance_m = self._slack_m + self._params.share * max(abs(reach_m), abs(rolled_m))
        return abs(rolled_m - reach_m) > (tolerance_m / 2 if wheel in state.excluded else tolerance_m)


def _faded(lately: Sequence[float], kept: float, newly: Iterable[float]) -> tuple[float, ...]:
    """What is kept of a memory, with what is new."""
    return tuple([kept * old + new for old, new in zip(lately, newly, strict=True)])
