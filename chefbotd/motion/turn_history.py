"""How far the robot has turned in the last seconds, for readings that come late."""

from typing import Final, TypeAlias

from chefbotd.core.record import MutableState

Turned: TypeAlias = tuple[float, float, float, float]
"""A time (s), the turn by the wheels up to then (rad), the turn that the filter used (rad), and its variance (rad²)."""

KEPT_S: Final = 2.5
"""Readings that are up to two seconds late have a place, and half a second before it."""

LAGS_S: Final = tuple(k * 0.05 for k in range(-2, 25))
"""Lags that are tried. The FIFO of an MPU-6050 holds 24 samples of the sketch's 20 Hz: 1.2 s."""


class TurnHistory(MutableState):
    """The turns of the last 2.5 s, the newest last; the sums never jump."""

    turns: list[Turned] = []

    def add(self, stamp_s: float, wheels_rad: float, used_rad: float, variance_rad2: float) -> None:
        """Add a motion that ended at ``stamp_s``."""
        turns = self.turns
        if turns:
            _, wheels, used, variance = turns[-1]
            turns.append((stamp_s, wheels + wheels_rad, used + used_rad, variance + variance_rad2))
            if turns[0][0] < stamp_s - KEPT_S:
                del turns[0]
        else:
            turns.append((stamp_s, wheels_rad, used_rad, variance_rad2))

    def turned_at(self, stamp_s: float) -> Turned | None:
        """The sums at a time, between two entries in proportion; None where it is later or no longer kept."""
        turns = self.turns
        if not turns or stamp_s > turns[-1][0] or stamp_s < turns[0][0]:
            return None
        k = len(turns) - 1
        while turns[k][0] > stamp_s:
            k -= 1
        before = turns[k]
        if before[0] == stamp_s:
            return before
        after = turns[k + 1]
        share = (stamp_s - before[0]) / (after[0] - before[0])
        return (
            stamp_s,
            before[1] + share * (after[1] - before[1]),
            before[2] + share * (after[2] - before[2]),
            before[3] + share * (after[3] - before[3]),
        )


def scatter(history: TurnHistory, readings: list[tuple[float, float]], lag_s: float) -> float | None:
    """The variance (rad²) of headings less the turn at their times; None where too few times are kept.

    ``readings`` are times and unwrapped headings. The worst fifth of them is left out, since some may be outliers.
    """
    offsets = []
    for stamp_s, heading_rad in readings:
        turned = history.turned_at(stamp_s - lag_s)
        if turned is not None:
            offsets.append(heading_rad - turned[2])
    if len(offsets) < max(6, len(readings) // 2):
        return None
    offsets.sort()
    middle = offsets[len(offsets) // 2]
    squares = sorted([(offset - middle) ** 2 for offset in offsets])
    inner = squares[: len(squares) - len(squares) // 5]
    return sum(inner) / len(inner)


def best_lag(history: TurnHistory, readings: list[tuple[float, float]]) -> tuple[float, float] | None:
    """The lag at which the headings agree best with the turns (s), and the variance that is left (rad²).

    The minimum of a parabola through the best of ``LAGS_S`` and its neighbours. None: too little is kept, or
    the best lag is the first or the last one.
    """
    tried = [(lag_s, scatter(history, readings, lag_s)) for lag_s in LAGS_S]
    fits = [(lag_s, variance) for lag_s, variance in tried if variance is not None]
    if len(fits) < 3:
        return None
    k = min(range(len(fits)), key=lambda index: fits[index][1])
    lag_s, least = fits[k]
    if not 0 < k < len(fits) - 1:
        return None
    before, after = fits[k - 1][1], fits[k + 1][1]
    bend = before - 2 * least + after
    if bend <= 0:
        return lag_s, least
    return lag_s + 0.5 * (before - after) / bend * (LAGS_S[1] - LAGS_S[0]), least
