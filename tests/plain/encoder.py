"""Encoder counts to motion by what is seen: all readings are kept, and each question is asked of them anew."""

import math
from collections.abc import Sequence

from chefbotd.motion.encoder import GAP_CYCLES, LOST_LINES_S, EncoderParameters, Reading

Sample = tuple[float, tuple[int, ...]]


class Decoder:
    """Decodes a series of readings; ``good`` are those believed since the last reference, in signed counts."""

    def __init__(self, params: EncoderParameters, signs: tuple[int, ...]) -> None:
        self._params, self._signs = params, signs
        self._base: Sample | None = None
        self._suspect: Sample | None = None
        self._agreeing = 0
        self._totals = (0,) * len(signs)
        self._good: list[Sample] = []

    def decode(self, counts: tuple[int, ...], board_s: float) -> Reading:
        """What a reading says."""
        now, half = (board_s, counts), 2 ** (self._params.width_bits - 1)
        if self._base is None or self._most(self._base, now) >= half:
            self._restart(now)
            return self._nothing(rebased=True)
        moved = self._moved(self._base, now)
        jumped = [i for i, counted in enumerate(moved) if abs(counted) > self._most(self._base, now)]
        if jumped:
            return self._refuse(now, tuple(jumped))
        agrees = self._suspect is not None and self._may_follow(self._suspect, now)
        if self._surprises(moved, board_s) and not agrees:
            self._suspect, self._agreeing = now, 0
            return self._nothing(unconfirmed=True)
        return self._believe(now, moved)

    def _believe(self, now: Sample, moved: tuple[int, ...]) -> Reading:
        steps = [sign * counted for sign, counted in zip(self._signs, moved, strict=True)]
        self._totals = tuple(total + step for total, step in zip(self._totals, steps, strict=True))
        kept = [sample for sample in self._good if sample[0] < now[0]]
        self._good = [*kept[-(self._params.velocity_window - 1) :], (now[0], self._totals)]
        self._base, self._suspect, self._agreeing = now, None, 0
        return Reading(
            self._radians(steps),
            self._radians(self._totals),
            self._velocity(),
            measured_over_s=now[0] - self._good[0][0],
        )

    def _refuse(self, now: Sample, jumped: tuple[int, ...]) -> Reading:
        agrees = self._suspect is not None and self._may_follow(self._suspect, now)
        self._agreeing = 1 + (self._agreeing if agrees else 0)
        told = self._nothing(jumped)
        if self._agreeing < self._params.confirmations:
            self._suspect = now
            return told
        self._restart(now)
        return Reading(told.travel_rad, told.position_rad, told.velocity_rad_s, jumped, rebased=True)

    def _restart(self, now: Sample) -> None:
        self._base, self._suspect, self._agreeing = now, None, 0
        self._good = [(now[0], self._totals)]

    def _nothing(
        self, jumped: tuple[int, ...] = (), *, rebased: bool = False, unconfirmed: bool = False
    ) -> Reading:
        still = (0.0,) * len(self._signs)
        return Reading(
            still, self._radians(self._totals), self._velocity(), jumped, rebased, unconfirmed=unconfirmed
        )

    def _moved(self, before: Sample, now: Sample) -> tuple[int, ...]:
        turn = 2**self._params.width_bits
        changes = [(new - old) % turn for old, new in zip(before[1], now[1], strict=True)]
        return tuple(change - turn if change >= turn // 2 else change for change in changes)

    def _most(self, before: Sample, now: Sample) -> float:
        turned_rad = self._params.max_speed_rad_s * max(now[0] - before[0], 0.0)
        return turned_rad / math.tau * self._params.counts_per_turn + self._params.tolerance_counts

    def _may_follow(self, before: Sample, now: Sample) -> bool:
        return all(abs(counted) <= self._most(before, now) for counted in self._moved(before, now))

    def _surprises(self, moved: tuple[int, ...], board_s: float) -> bool:
        most_rad_s2, counts_per_rad = (
            self._params.max_acceleration_rad_s2,
            self._params.counts_per_turn / math.tau,
        )
        if most_rad_s2 is None:
            return False
        elapsed_s, window_s = board_s - self._good[-1][0], self._good[-1][0] - self._good[0][0]
        judged_s = elapsed_s
        if len(self._good) > 1 and elapsed_s < LOST_LINES_S:
            cycles_s = [
                later[0] - earlier[0] for earlier, later in zip(self._good, self._good[1:], strict=False)
            ]
            judged_s = min(elapsed_s, GAP_CYCLES * min(cycles_s))
        allowed_rad = most_rad_s2 * judged_s * (window_s + judged_s) / 2
        tolerance = (
            max(allowed_rad, 0.0) * counts_per_rad + self._params.tolerance_counts
        )  # a clock may go back
        expected = [velocity * elapsed_s * counts_per_rad for velocity in self._velocity()]
        wheels = zip(self._signs, moved, expected, strict=True)
        return any(abs(sign * counted - way) > tolerance for sign, counted, way in wheels)

    def _velocity(self) -> tuple[float, ...]:
        (began_s, first), (ended_s, last) = self._good[0], self._good[-1]
        if len(self._good) == 1:
            return (0.0,) * len(last)
        rad_s = [
            (b - a) * math.tau / self._params.counts_per_turn / (ended_s - began_s)
            for a, b in zip(first, last, strict=True)
        ]
        return tuple(v if abs(v) >= self._params.standstill_rad_s else 0.0 for v in rad_s)

    def _radians(self, counts: Sequence[int]) -> tuple[float, ...]:
        return tuple(counted * math.tau / self._params.counts_per_turn for counted in counts)
