"""What odometry remembers of the IMU and the wheels, and how it takes a heading of the IMU.

A heading counts at its own time: what the robot has turned since then is added. One that is far from the expected
heading is refused. After several in a row the estimate is widened and the heading used: the filter must not shut out a
good sensor for an error of its own. Headings that are late by a constant lag are given their own time. While the lag
changes, because the board was silent and its IMU's queue hands out old samples, they are dropped.
"""

import math
from typing import Final

from msgspec import field

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import MutableState, replace
from chefbotd.motion import motion_filter
from chefbotd.motion.bias_evidence import NO_EVIDENCE, BiasEvidence
from chefbotd.motion.imu_agreement import ImuAgreement
from chefbotd.motion.imu_track import Heading, HeadingTrack, RateTrack
from chefbotd.motion.motion_filter import MotionEstimate
from chefbotd.motion.turn_history import TurnHistory, best_lag, scatter
from chefbotd.motion.wheel_slip import StallWatch, TurnSample, TurnWatch

GATE: Final = 16.0
"""A heading more than four sigmas from the expected one is refused."""

REFUSED_IN_A_ROW: Final = 5
REFUSED_S: Final = 0.25
"""So many headings are refused in a row, over this time at least, before one is believed after all."""

OUTLIER_MEMORY: Final = 100.0
"""The share of refused readings is that of so many."""

SILENT_S: Final = 0.2
"""A board that sends nothing for so long has an IMU whose queue fills up."""

REGULAR_SHARE: Final = 0.9
REGULAR_CYCLES: Final = 3
"""The queue is empty again when so many cycles have lasted as long as usual: the sketch then waits for a sample."""

RESTS_S: Final = 0.5
DRIFT_EVERY_S: Final = 1.0
TURNED_BY_HAND_S: Final = 3.0
MOST_DRIFT_RAD_S: Final = 0.08
"""A motion processor that settles drifts by up to 3 degrees a second for 20 s; a robot that turns faster is turned."""

FIRST_READINGS: Final = 9
LAG_EVERY_S: Final = 0.5
LAG_READINGS: Final = 20
LAG_SPACING_S: Final = 0.045
"""Readings that are so far apart show the lag: the last 20, a second at least."""

LAG_MISFIT: Final = 2.5
"""The lag is looked for where headings scatter so many times as much as their noise allows."""


class FusionState(MutableState):
    """What fused odometry remembers; ``imu_s`` is when the IMU was last heard.

    ``irregular_cycles`` is how many cycles of the usual duration, ``cycle_s``, are awaited before headings are used.
    ``by_wheels`` is the pose by the wheels alone since the IMU agreed with them last, ``rest_from`` the time, the
    IMU's heading and its offset from which on its drift is measured while the robot rests.
    ``drifted_rad`` is how far the heading has drifted, as far as that is known.
    ``unchanged_rad`` is how far the wheels have turned the robot while the IMU's values did not change, ``imu_repeats``
    how often it has sent them again, less those that did change.
    """

    estimate: MotionEstimate = MotionEstimate()
    stamp_s: float | None = None
    history: TurnHistory = field(default_factory=TurnHistory)
    rates: RateTrack = field(default_factory=RateTrack)
    headings: HeadingTrack = field(default_factory=HeadingTrack)
    turns: TurnWatch = field(default_factory=TurnWatch)
    stall: StallWatch = field(default_factory=StallWatch)
    waiting: list[Heading] = []
    readings: list[tuple[float, float]] = []
    has_rates: bool = False
    has_headings: bool = False
    has_offset: bool = False
    imu_s: float = -math.inf
    imu_values: tuple[float, ...] = ()
    imu_repeats: int = 0
    unchanged_rad: float = 0.0
    refused_in_a_row: int = 0
    refused_since_s: float = 0.0
    outlier_share: float = 0.0
    lag_s: float = 0.0
    lag_checked_s: float = -math.inf
    cycle_s: float | None = None
    irregular_cycles: int = 0
    resting_s: float = 0.0
    evidence: BiasEvidence = NO_EVIDENCE
    reach_rad: float = 0.0
    sides_m_s: tuple[float, float] = (0.0, 0.0)
    spikes: int = 0
    climb_share: float = 0.0
    is_lifted: bool = False
    agreement: ImuAgreement = field(default_factory=ImuAgreement)
    by_wheels: Pose2D | None = None
    rest_from: tuple[float, float, float] | None = None
    drifted_rad: float = 0.0


def note_refusal(state: FusionState, *, refused: bool) -> None:
    """Count a reading that was used, or refused."""
    state.outlier_share += (float(refused) - state.outlier_share) / OUTLIER_MEMORY


def note_cycle(state: FusionState, dt_s: float) -> None:
    """Follow the board's cycle: after a silence headings are late until cycles last as long as usual again."""
    if dt_s > SILENT_S:
        state.irregular_cycles = REGULAR_CYCLES
    elif state.cycle_s is None:
        state.cycle_s = dt_s or None
    elif state.irregular_cycles == 0:
        state.cycle_s += 0.05 * (dt_s - state.cycle_s)
    else:
        is_usual = dt_s >= REGULAR_SHARE * state.cycle_s
        state.irregular_cycles = state.irregular_cycles - 1 if is_usual else REGULAR_CYCLES


def take_headings(
    state: FusionState, noise_rad: float, limits: tuple[float, float], *, may_slip: bool
) -> None:
    """Take the headings that are not newer than the last travel of the wheels.

    Where there are no rates, they are also compared with the wheels; ``limits`` are those of ``TurnWatch.add``.
    """
    ready, newest_s = 0, state.history.turns[-1][0]
    for heading in state.waiting:
        if heading.stamp_s - state.lag_s > newest_s:
            break
        ready += 1
        if state.irregular_cycles:
            state.readings.clear()
            state.turns.clear()
            continue
        if not state.has_rates:
            _compare(state, heading, limits, may_slip=may_slip)
        if heading.is_new or not state.has_offset:
            _take(state, heading, noise_rad)
    del state.waiting[:ready]
    if state.stamp_s is not None and state.stamp_s - state.lag_checked_s >= LAG_EVERY_S:
        state.lag_checked_s = state.stamp_s
        check_lag(state, noise_rad)


def _compare(state: FusionState, heading: Heading, limits: tuple[float, float], *, may_slip: bool) -> None:
    turned = state.history.turned_at(heading.stamp_s - state.lag_s)
    if turned is None:
        return
    sample = TurnSample(heading.stamp_s, heading.heading_rad, turned[1], state.reach_rad)
    off_rad = state.turns.add(sample, *limits, may_slip=may_slip)
    if off_rad:
        state.estimate = motion_filter.widen(state.estimate, 0.0, off_rad * off_rad)


def _take(state: FusionState, heading: Heading, noise_rad: float) -> None:
    """Correct the estimate by a heading, as it would be now."""
    then, last = state.history.turned_at(heading.middle_s - state.lag_s), state.history.turns[-1]
    if then is None:
        return
    if not state.readings or heading.middle_s - state.readings[-1][0] >= LAG_SPACING_S:
        state.readings.append((heading.middle_s, heading.middle_rad - state.drifted_rad))
        if len(state.readings) > LAG_READINGS:
            del state.readings[0]
    heading_rad = heading.middle_rad + last[2] - then[2]
    variance = noise_rad * noise_rad + last[3] - then[3]
    if not state.has_offset:
        _begin(state, noise_rad)
        return
    if state.resting_s > RESTS_S and _hold(state, heading, heading_rad, variance, noise_rad):
        return
    off_rad, expected = motion_filter.surprise(state.estimate, heading_rad, variance)
    refused = off_rad * off_rad > GATE * expected
    note_refusal(state, refused=refused)
    if refused:
        if not state.refused_in_a_row:
            state.refused_since_s = heading.stamp_s
        state.refused_in_a_row += 1
        if state.refused_in_a_row < REFUSED_IN_A_ROW or heading.stamp_s - state.refused_since_s < REFUSED_S:
            return
        if state.agreement.contradicts:
            return
        state.estimate = motion_filter.widen(state.estimate, 0.0, off_rad * off_rad)
    state.refused_in_a_row = 0
    state.estimate = motion_filter.with_imu_heading(state.estimate, heading_rad, variance)


def _hold(
    state: FusionState, heading: Heading, heading_rad: float, variance: float, noise_rad: float
) -> bool:
    """Let a heading that changes at rest move the offset, and show the drift; False where the robot is being turned."""
    estimate = state.estimate
    if state.rest_from is None:
        state.rest_from = heading.middle_s, heading.middle_rad, estimate.offset_rad
    from_s, from_rad, offset_rad = state.rest_from
    lasted_s, drifted_rad = heading.middle_s - from_s, heading.middle_rad - from_rad
    if abs(drifted_rad) > MOST_DRIFT_RAD_S * lasted_s + 3 * noise_rad:
        state.estimate = replace(estimate, offset_rad=offset_rad + estimate.bias_rad_s * lasted_s)
        state.rest_from, state.resting_s = None, -TURNED_BY_HAND_S
        return False
    estimate = motion_filter.with_new_offset(estimate, heading_rad, variance)
    if lasted_s >= DRIFT_EVERY_S:
        drift_rad_s, sigma_rad_s = drifted_rad / lasted_s, math.sqrt(2) * noise_rad / lasted_s
        off_rad_s = abs(drift_rad_s - estimate.bias_rad_s)
        if off_rad_s > sigma_rad_s:  # more than it is expected to drift: it settles
            estimate = motion_filter.with_unknown_bias(estimate, off_rad_s)
        estimate = motion_filter.with_bias(estimate, drift_rad_s, sigma_rad_s * sigma_rad_s)
        state.rest_from = heading.middle_s, heading.middle_rad, estimate.offset_rad
    state.estimate = estimate
    return True


def _begin(state: FusionState, noise_rad: float) -> None:
    """Begin with the middle one of the first headings: the first alone may be an outlier."""
    if len(state.readings) < FIRST_READINGS:
        return
    turns = [
        (rad, turned)
        for at_s, rad in state.readings
        if (turned := state.history.turned_at(at_s - state.lag_s))
    ]
    if not turns:
        return
    last = state.history.turns[-1]
    headings = sorted([rad + last[2] - turned[2] for rad, turned in turns])
    variance = noise_rad * noise_rad + last[3] - turns[0][1][3]
    heading_rad = headings[len(headings) // 2]
    state.estimate = motion_filter.with_new_offset(state.estimate, heading_rad, variance)
    state.has_offset = True


def check_lag(state: FusionState, noise_rad: float) -> None:
    """Find by how much the headings come late, where they scatter about the turns as if they did."""
    if len(state.readings) < LAG_READINGS:
        return
    limit = LAG_MISFIT * noise_rad * noise_rad
    present = scatter(state.history, state.readings, state.lag_s)
    if present is None or present <= limit:
        return
    best = best_lag(state.history, state.readings)
    if best is None or best[1] > min(limit, 0.25 * present):
        return
    state.lag_s = best[0]
    state.estimate = motion_filter.widen(state.estimate, 0.0, present)
    state.turns.clear()
    state.refused_in_a_row = 0
