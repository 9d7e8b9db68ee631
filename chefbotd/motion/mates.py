"""Wheels on the same side that disagree (slip, a broken encoder): which of them to believe.

Mates roll over the same ground at the same speed. What each has rolled lately is compared, in a memory that fades.
Where they disagree, the one nearest to what is expected is believed, and whoever is far from it is left out until it
agrees again. What is expected:

- of three or more mates their median, since one cannot outvote two;
- of two that are driven, what they were asked for, as far as the other side does what it is asked for: a robot that
  is held back is slow on both sides, a dead encoder is on one;
- of two that are not driven, the farther one: only the ground can have turned it.

Mates that are asked for different speeds (``set_wheel_velocities``) are not compared.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.motion.kinematics import Kinematics, without


class MatesParameters(Parameters):
    """When mates disagree: by more than ``slack_m``, two counts, and ``share`` of what they have rolled lately.

    ``memory_s`` is how long "lately" is: the time constant with which travel is forgotten. A wheel that is left out
    comes back once it is within half of that.
    """

    memory_s: float = Field(default=0.2, gt=0, le=10)
    slack_m: float = Field(default=0.0015, gt=0, le=1)
    share: float = Field(default=0.1, gt=0, lt=1)


MOST_PACE = 1.5
"""However far ahead of its command the other side is, more than this is not expected of this one."""


@dataclass(frozen=True, slots=True)
class MatesState:
    """What each wheel has rolled lately and what it was asked to.

    ``led`` are the wheels that are not believed, each with the mate that is: pairs of indices.
    """

    rolled_m: tuple[float, ...]
    asked_m: tuple[float, ...]
    led: tuple[tuple[int, int], ...] = ()

    @property
    def left_out(self) -> tuple[int, ...]:
        """The indices of the wheels that are not believed."""
        return tuple([wheel for wheel, _ in self.led])


class Mates:
    """Compares the wheels of each side; where there is one a side, there is nothing to compare."""

    def __init__(self, params: MatesParameters, kinematics: Kinematics, counts_per_turn: float) -> None:
        self._params, self._kinematics = params, kinematics
        self._slack_m = params.slack_m + 2 * max(kinematics.radii_m) * math.tau / counts_per_turn
        self._sides = (kinematics.left, kinematics.right), (kinematics.right, kinematics.left)
        self._any = max(len(kinematics.left), len(kinematics.right)) > 1
        nothing = (0.0,) * len(kinematics.radii_m)
        self.start = MatesState(nothing, nothing)

    def compare(
        self, state: MatesState, travel_rad: Sequence[float], setpoint_m_s: Sequence[float], dt_s: float
    ) -> MatesState:
        """The wheels turned so far in ``dt_s``, in which they were asked for these rim speeds."""
        if not self._any:
            return state
        kept = math.exp(-max(dt_s, 0.0) / self._params.memory_s)
        turned = zip(state.rolled_m, travel_rad, self._kinematics.radii_m, strict=True)
        rolled_m = tuple([kept * rolled + angle * radius for rolled, angle, radius in turned])
        wanted = zip(state.asked_m, setpoint_m_s, strict=True)
        asked_m = tuple([kept * asked + speed * dt_s for asked, speed in wanted])
        now = MatesState(rolled_m, asked_m, state.led)
        led = [pair for side, other in self._sides for pair in self._strays(now, side, other)]
        return MatesState(rolled_m, asked_m, tuple(led))

    def credit(self, state: MatesState, effort: tuple[float, ...]) -> tuple[float, ...]:
        """The wheels' effort, -1 to 1; at least a half for those left out: small as it was, their mates turned by it."""
        if not state.led:
            return effort
        out = state.left_out
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
        if len(side) == 2 and abs(asked_m[0]) <= self._slack_m:
            return max(side, key=lambda i: abs(state.rolled_m[i]))
        if len(side) == 2:
            expected_m = asked_m[0] * self._pace(state, other)
        else:
            expected_m = median([state.rolled_m[i] for i in side])
        return min(side, key=lambda i: abs(state.rolled_m[i] - expected_m))

    def _pace(self, state: MatesState, side: tuple[int, ...]) -> float:
        """How much of what it was asked for a side does: its best wheel, of those believed so far."""
        ratios = [
            state.rolled_m[i] / state.asked_m[i]
            for i in without(side, state.left_out)
            if abs(state.asked_m[i]) > self._slack_m
        ]
        best = min(ratios, key=lambda ratio: abs(ratio - 1.0), default=1.0)
        return min(max(best, 0.0), MOST_PACE)

    def _is_apart(self, state: MatesState, wheel: int, reach_m: float) -> bool:
        rolled_m = state.rolled_m[wheel]
        tolerance_m = self._slack_m + self._params.share * max(abs(reach_m), abs(rolled_m))
        return abs(rolled_m - reach_m) > (tolerance_m / 2 if wheel in state.left_out else tolerance_m)
