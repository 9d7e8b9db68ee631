"""Converts encoder counts to wheel angles: wrap, sign, scale, velocity, and refusal of impossible readings.

A number that lost digits on the wire still parses, so every change is compared with the time it took. If the change of
one wheel is impossible, the whole reading is refused. The next good reading catches up for all wheels, so nothing is
lost. A change that is possible but far from where the wheel was heading is believed when the next reading agrees with
it.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise, repeat
from operator import add, mul, sub

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record, replace


class CountedBy(StrEnum):
    """Whose counts ``counts_per_turn`` has: a published sketch's, or our own firmware's, which counts all four edges."""

    SKETCH = "sketch"
    FIRMWARE = "firmware"


class EncoderParameters(Parameters):
    """What the counters look like, and what the wheels can do.

    If ``confirmations`` refused readings in a row agree with each other, the counters themselves have moved. A
    velocity is the mean over the last ``velocity_window`` readings, and zero below ``standstill_rad_s``. A change that
    needs an acceleration of more than ``max_acceleration_rad_s2`` is believed only when the next reading confirms it
    (None: at once).
    """

    counts_per_turn: float = Field(gt=0, le=1e9)
    """What the board counts in one turn of the wheel, gearbox included."""
    counted_by: CountedBy = CountedBy.SKETCH
    """Who counted: a sketch counts one edge of four, our firmware all of them."""
    width_bits: int = Field(default=32, ge=8, le=64)
    """The width of the board's counters, at which they wrap round."""
    max_speed_rad_s: float = Field(gt=0, le=1e4)
    """The fastest that a wheel can turn; what would need more is a damaged line and is refused."""
    tolerance_counts: int = Field(default=4, ge=0, le=1000)
    """So many counts more than the fastest speed allows are still believed, for the edges of a reading."""
    velocity_window: int = Field(default=5, ge=2, le=100)
    """A wheel's speed is the mean over so many readings."""
    standstill_rad_s: float = Field(default=0.0, ge=0)
    """A wheel that turns more slowly than this counts as standing."""
    confirmations: int = Field(default=3, ge=1, le=1000)
    max_acceleration_rad_s2: float | None = Field(default=None, gt=0, le=1e5)


LOST_LINES_S = 0.3
"""A longer gap is the board's own pause, after which the next reading may be as long in coming."""

GAP_CYCLES = 2
"""A gap of lost lines allows no more than so many cycles: the longer it is, the more damaged counts look possible."""


NARROW_BITS, ENOUGH_WRAPS = 16, 2
"""A board of 8 bits may count in an int of 16. The first wrap loses travel; from the second one on it is recognised."""


class Sample(Record, frozen=True):
    """All wheels' counts at one board time."""

    board_s: float
    counts: tuple[int, ...]


class EncodersState(Record, frozen=True):
    """What decoding remembers.

    ``base`` is the last good reading as on the wire (None: the next reading becomes the reference). ``totals`` are the
    signed counts since the start, integers so that positions are exact. ``window`` holds the latest totals, newest
    last, and ``velocity_rad_s`` is the mean over it. ``suspect`` is the last refused reading, and ``agreeing`` the
    number of refused readings that agree, itself included. ``narrow_wraps`` counts what looked like counters of
    ``NARROW_BITS`` bits that wrapped.
    """

    base: Sample | None = None
    totals: tuple[int, ...] = ()
    window: tuple[Sample, ...] = ()
    velocity_rad_s: tuple[float, ...] = ()
    suspect: Sample | None = None
    agreeing: int = 0
    narrow_wraps: int = 0

    def width_bits(self, params: EncoderParameters) -> int:
        """How many bits the counters have: as configured, or as was recognised."""
        return NARROW_BITS if self.narrow_wraps >= ENOUGH_WRAPS else params.width_bits


START = EncodersState()


class Reading(Record, frozen=True):
    """One encoder frame per wheel, in the order of the configured wheels, forward positive.

    The velocity is a mean over the last ``measured_over_s`` of the board's time, 0 where nothing could be measured. A
    refused reading has no travel and keeps the last position and velocity; ``jumped`` are the indices of the wheels to
    blame, none when it is merely ``unconfirmed``. ``rebased``: the counters were taken as a new reference, without
    travel. ``recognised_narrow``: from now on the counters are taken to wrap at ``NARROW_BITS`` bits.
    """

    travel_rad: tuple[float, ...]
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]
    jumped: tuple[int, ...] = ()
    rebased: bool = False
    unconfirmed: bool = False
    measured_over_s: float = 0.0
    recognised_narrow: bool = False

    @property
    def refused(self) -> bool:
        """Whether nothing of this frame is believed, because a wheel jumped or a change waits for confirmation."""
        return bool(self.jumped) or self.unconfirmed


def rebase(state: EncodersState) -> EncodersState:
    """Take the next reading as the new reference, without travel: after a board reset. Positions go on."""
    return EncodersState(totals=state.totals, narrow_wraps=state.narrow_wraps)


def decode(
    params: EncoderParameters,
    signs: tuple[int, ...],
    state: EncodersState,
    counts: tuple[int, ...],
    board_s: float,
    rate_counts_s: tuple[float, ...] | None = None,
) -> tuple[EncodersState, Reading]:
    """The next state, and the reading of the frame; ``signs`` is +1 or -1 per wheel.

    Where the edges' own timing is known, ``rate_counts_s`` is the velocity, instead of the window's mean. If a wheel
    may have turned by half the counter's range since the last good reading, its direction is ambiguous, and the
    reading becomes a new reference. Raises ``ValueError`` unless there is one count per sign.
    """
    sample, base = Sample(board_s, counts), state.base
    if base is None:
        return _take_reference(params, signs, state, sample)
    most = _most_counts(params, board_s - base.board_s)
    bits = params.width_bits if not state.narrow_wraps else state.width_bits(params)
    if most >= 1 << (bits - 1):
        return _take_reference(params, signs, state, sample)
    deltas = tuple(map(sub, counts, base.counts))
    if max(map(abs, deltas)) > most or len(counts) != len(signs):
        deltas = _deltas(bits, base, sample)  # a counter may have wrapped
    if max(map(abs, deltas)) > most:
        jumped = tuple([i for i, d in enumerate(deltas) if abs(d) > most])
        refused = _refuse(params, state, sample, jumped)
        if refused[0].narrow_wraps == ENOUGH_WRAPS > state.narrow_wraps:
            recognised = replace(state, narrow_wraps=ENOUGH_WRAPS)
            turned, reading = decode(params, signs, recognised, counts, board_s, rate_counts_s)
            return turned, replace(reading, recognised_narrow=True)
        return refused
    steps = tuple(map(mul, signs, deltas))
    if _surprises(params, state, steps, board_s) and not _fits(params, state, sample):
        waiting = replace(state, suspect=sample, agreeing=0)
        return waiting, replace(_no_travel(params, waiting), unconfirmed=True)
    turned, reading = _accept(params, state, sample, steps)
    if rate_counts_s is None:
        return turned, reading
    signed = tuple([sign * rate for sign, rate in zip(signs, rate_counts_s, strict=True)])
    velocity_rad_s = _standing_still(params, _radians(params, signed))
    since_last_s = max(0.0, board_s - base.board_s)
    return turned, replace(reading, velocity_rad_s=velocity_rad_s, measured_over_s=since_last_s)


def _take_reference(
    params: EncoderParameters, signs: tuple[int, ...], state: EncodersState, sample: Sample
) -> tuple[EncodersState, Reading]:
    if len(sample.counts) != len(signs):
        raise ValueError(f"expected {len(signs)} counts, got {sample.counts}")
    totals = state.totals or (0,) * len(signs)
    rebased = _standing(sample, totals, state.narrow_wraps)
    return rebased, _no_travel(params, rebased, rebased=True)


def _accept(
    params: EncoderParameters, state: EncodersState, sample: Sample, steps: tuple[int, ...]
) -> tuple[EncodersState, Reading]:
    """The state and the reading after counts that are believed; ``steps`` are signed, forward positive."""
    totals = tuple(map(add, state.totals, steps))
    window = _extend(state.window, Sample(sample.board_s, totals), params.velocity_window)
    velocity_rad_s = _velocity(params, window)
    reading = Reading(
        _radians(params, steps),
        _radians(params, totals),
        velocity_rad_s,
        measured_over_s=sample.board_s - window[0].board_s,
    )
    turned = EncodersState(sample, totals, window, velocity_rad_s, narrow_wraps=state.narrow_wraps)
    return turned, reading


def _standing(sample: Sample, totals: tuple[int, ...], narrow_wraps: int) -> EncodersState:
    """The state after a reading that is a new reference."""
    still = (0.0,) * len(totals)
    return EncodersState(sample, totals, (Sample(sample.board_s, totals),), still, narrow_wraps=narrow_wraps)


def _refuse(
    params: EncoderParameters, state: EncodersState, sample: Sample, jumped: tuple[int, ...]
) -> tuple[EncodersState, Reading]:
    agreeing = 1 + (state.agreeing if _fits(params, state, sample) else 0)
    if agreeing < params.confirmations:
        waiting = replace(state, suspect=sample, agreeing=agreeing)
        return waiting, _no_travel(params, waiting, jumped)
    wraps = state.narrow_wraps + _wrapped_narrowly(params, state.base, sample)
    return _standing(sample, state.totals, wraps), replace(_no_travel(params, state, jumped), rebased=True)


def _wrapped_narrowly(params: EncoderParameters, base: Sample | None, sample: Sample) -> bool:
    """Whether counters of ``NARROW_BITS`` bits, signed or not, may have come from ``base`` to ``sample`` by wrapping."""
    if base is None or params.width_bits <= NARROW_BITS:
        return False
    span, counts = 1 << NARROW_BITS, (*base.counts, *sample.counts)
    least, most_counts = min(counts), max(counts)
    if not any(start <= least and most_counts < start + span for start in (0, -span // 2)):
        return False
    most = _most_counts(params, sample.board_s - base.board_s)
    return max(map(abs, _deltas(NARROW_BITS, base, sample))) <= most


def _no_travel(
    params: EncoderParameters, state: EncodersState, jumped: tuple[int, ...] = (), rebased: bool = False
) -> Reading:
    """A reading with the position and velocity that the state already had."""
    nothing = (0.0,) * len(state.totals)
    position_rad = _radians(params, state.totals)
    return Reading(nothing, position_rad, state.velocity_rad_s, jumped, rebased)


def _deltas(bits: int, before: Sample, after: Sample) -> tuple[int, ...]:
    """Change of each counter of so many bits the short way round, in [-half, half) of its range."""
    half = 1 << (bits - 1)
    mask = (half << 1) - 1
    pairs = zip(before.counts, after.counts, strict=True)
    return tuple([((new - old + half) & mask) - half for old, new in pairs])


def _most_counts(params: EncoderParameters, elapsed_s: float) -> float:
    """How far a wheel can have turned; a time that went back counts as zero."""
    if elapsed_s <= 0:
        return params.tolerance_counts
    return params.max_speed_rad_s * elapsed_s / math.tau * params.counts_per_turn + params.tolerance_counts


def _surprises(
    params: EncoderParameters, state: EncodersState, steps: tuple[int, ...], board_s: float
) -> bool:
    """Whether a wheel is farther from its expected position than its acceleration allows.

    The velocity is the window's mean, so half of the window old: it may have changed by ``a (span + elapsed) / 2``.
    To wait for the next reading costs a cycle, so after lost lines it is asked for all the sooner.
    """
    if params.max_acceleration_rad_s2 is None:
        return False
    newest_s = state.window[-1].board_s
    elapsed_s = judged_s = board_s - newest_s
    counts_per_radian = params.counts_per_turn / math.tau
    expected = elapsed_s * counts_per_radian
    least = params.tolerance_counts
    off = list(map(sub, steps, map(mul, state.velocity_rad_s, repeat(expected))))
    if -least <= min(off) and max(off) <= least:
        return False
    window_s = newest_s - state.window[0].board_s
    if window_s and elapsed_s < LOST_LINES_S:
        cycle_s = min([later.board_s - earlier.board_s for earlier, later in pairwise(state.window)])
        judged_s = min(elapsed_s, GAP_CYCLES * cycle_s)
    tolerance_rad = params.max_acceleration_rad_s2 * judged_s * (window_s + judged_s) / 2
    tolerance = tolerance_rad * counts_per_radian + least
    return not (-tolerance <= min(off) and max(off) <= tolerance)


def _fits(params: EncoderParameters, state: EncodersState, after: Sample) -> bool:
    """Whether a reading agrees with the one that was refused last."""
    before = state.suspect
    if before is None:
        return False
    deltas = _deltas(state.width_bits(params), before, after)
    return max(map(abs, deltas)) <= _most_counts(params, after.board_s - before.board_s)


def _extend(window: tuple[Sample, ...], newest: Sample, size: int) -> tuple[Sample, ...]:
    """The window with a new sample; board times in it always increase, so that spans are never zero."""
    if window[-1].board_s >= newest.board_s:
        window = tuple([sample for sample in window if sample.board_s < newest.board_s])
    return (*window[-(size - 1) :], newest)


def _velocity(params: EncoderParameters, window: tuple[Sample, ...]) -> tuple[float, ...]:
    oldest, newest = window[0], window[-1]
    if oldest is newest:
        return (0.0,) * len(newest.counts)
    scale = math.tau / params.counts_per_turn / (newest.board_s - oldest.board_s)
    return _standing_still(params, tuple(map(mul, map(sub, newest.counts, oldest.counts), repeat(scale))))


def _standing_still(params: EncoderParameters, velocity_rad_s: tuple[float, ...]) -> tuple[float, ...]:
    """The velocities; those too slow to tell from standstill are zero."""
    least = params.standstill_rad_s
    if min(map(abs, velocity_rad_s)) >= least:
        return velocity_rad_s
    return tuple([0.0 if -least < v < least else v for v in velocity_rad_s])


def _radians(params: EncoderParameters, counts: Sequence[float]) -> tuple[float, ...]:
    return tuple(map(mul, counts, repeat(math.tau / params.counts_per_turn)))
