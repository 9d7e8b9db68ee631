"""Localization as one pure step per scan: tracks a known pose, and searches for an unknown one.

Values in, values out: the time is an argument, nothing is left to chance, and no step takes long, because a search of
the whole map goes on from step to step.

The published ``map_from_odom`` follows the estimate at a bounded rate, or reports a jump. What is bounded is how fast
the robot's own pose is corrected, not where the frame's origin goes: far from the origin of ``odom``, a hundredth of a
radian moves the robot by centimetres.
"""

import math
from typing import Final

import numpy as np

from chefbotd.components.localization.algorithms import searching as search_room
from chefbotd.components.localization.algorithms.doubt import (
    CONFIRMED_FIT,
    CONFIRMED_SCANS,
    LOST_AFTER_S,
    check_elsewhere,
    doubt_pose,
    misfit,
    without_evidence,
)
from chefbotd.components.localization.algorithms.hypotheses import MOVING_FIT, Hypothesis, likely, sure
from chefbotd.components.localization.algorithms.searching import LocalizationMap, Searching
from chefbotd.components.localization.algorithms.state import (
    HAS_POSE,
    Localization,
    Odometry,
    PoseEvent,
    PoseState,
    carry_estimate,
    forgotten,
    is_sure,
    on_event,
)
from chefbotd.components.localization.algorithms.tracking import (
    MIN_OVERLAP,
    SUSPICIOUS_DROP,
    PoseEstimate,
    track_pose,
)
from chefbotd.components.mapping.algorithms.state import Scan
from chefbotd.core.poses import Floats, between, compose, inverse
from chefbotd.core.record import Record, replace

RATE_M_S: Final = 0.2
RATE_RAD_S: Final = 0.35
JUMP_M: Final = 0.3
JUMP_RAD: Final = 0.35


def correct_odom(
    published: Floats, map_from_base: Floats, odom_from_base: Floats, dt_s: float
) -> tuple[Floats, bool]:
    """The next ``map_from_odom``, ``dt_s`` after ``published``, and whether it jumped: then plans made with it are void.

    The robot is at ``map_from_base``.
    """
    shown = compose(published, odom_from_base)
    off = between(shown, map_from_base)
    distance_m, turn_rad = math.hypot(off[0], off[1]), abs(float(off[2]))
    if distance_m > JUMP_M or turn_rad > JUMP_RAD:
        return compose(map_from_base, inverse(odom_from_base)), True
    by_distance = RATE_M_S * dt_s / distance_m if distance_m > 0 else 1.0
    by_turn = RATE_RAD_S * dt_s / turn_rad if turn_rad > 0 else 1.0
    part = np.array([min(by_distance, 1.0), min(by_distance, 1.0), min(by_turn, 1.0)])
    return compose(compose(shown, part * off), inverse(odom_from_base)), False


SETTLE_S: Final = 3.0
"""If the best place fits badly for so long, nothing was found."""

USUAL_SHARE = 0.05
"""What a scan counts in the usual fit."""

LOOK_AROUND_EVERY = 3
"""Of scans that fit badly in a row, every third is searched further around: that takes long."""

WEAK_FIT: Final = 0.6
WEAK_AFTER_S: Final = 20.0
"""A pose whose scans fit worse than this is uncertain as well, and given up after so long."""


class LocalizationReport(Record, frozen=True):
    """What a step found: ``map_from_base`` is None while there is no one pose.

    ``map_from_odom`` follows it smoothly; where it could not, ``jumped`` says so. While it searches or is lost,
    ``alternatives`` are where the robot may well be, and ``searched`` is the share of the search that is done.
    """

    stamp_s: float
    state: PoseState
    event: PoseEvent | None
    map_from_base: PoseEstimate | None
    map_from_odom: Floats | None
    jumped: bool
    fit: float
    overlap: float
    alternatives: tuple[Hypothesis, ...]
    searched: float


def step(
    map_: LocalizationMap,
    state: Localization,
    stamp_s: float,
    odometry: Odometry,
    scan: Scan | None,
    *,
    auto_search: bool = True,
) -> tuple[Localization, LocalizationReport]:
    """Take a scan into account (None: there is only odometry).

    With ``auto_search`` a robot that is lost searches without being asked to.
    """
    state, event = carry_estimate(state, odometry), None
    if scan is not None and len(scan.points):
        if state.state in HAS_POSE and state.estimate is not None:
            state, event = _follow(map_, state, state.estimate, odometry.pose, stamp_s, scan)
            if state.is_unchecked and event is None:
                state, event = check_elsewhere(map_, state, odometry.pose, stamp_s, scan)
        else:
            state, event = _look(map_, state, odometry.pose, stamp_s, scan, auto_search=auto_search)
    if state.state is PoseState.LOCALIZED and state.estimate is not None and not is_sure(state.estimate):
        state, event = on_event(state, PoseEvent.MISFITS), PoseEvent.MISFITS
    state, jumped = _update_published(_time_uncertainty(state, stamp_s), stamp_s)
    return state, _report(state, stamp_s, event, jumped)


def _time_uncertainty(state: Localization, stamp_s: float) -> Localization:
    """The same, with the time since when its pose is uncertain."""
    if state.state is not PoseState.UNCERTAIN:
        return state if state.uncertain_since_s is None else replace(state, uncertain_since_s=None)
    return replace(state, uncertain_since_s=stamp_s) if state.uncertain_since_s is None else state


def advance_search(map_: LocalizationMap, state: Localization) -> Localization:
    """Go on with a search between two scans, a bounded bit."""
    if state.searching is None or state.odometry is None:
        return state
    if state.state is not PoseState.SEARCHING and not state.is_unchecked:
        return state
    pose = state.odometry.pose
    return replace(state, searching=search_room.advance_search(map_, state.searching, pose))


def _follow(
    map_: LocalizationMap,
    state: Localization,
    expected: PoseEstimate,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, PoseEvent | None]:
    """Match the scan about the estimate, and count whether scans fit."""
    around = state.misfits % LOOK_AROUND_EVERY == 0
    grids = map_.surfaces.grids
    track = track_pose(grids, expected, scan, state.usual_fit, may_search=around)
    agreement = track.agreement
    state = replace(state, estimate=track.estimate, fit=agreement.fit, overlap=agreement.overlap)
    if agreement.overlap < MIN_OVERLAP:
        return without_evidence(state, stamp_s)
    state = replace(state, no_evidence_since_s=None)
    if not track.matched or agreement.fit < WEAK_FIT:
        patience_s = WEAK_AFTER_S if track.matched else LOST_AFTER_S
        return misfit(state, stamp_s, patience_s)
    if track.moved and not state.is_unchecked:  # it was looked for nearby only: it may be somewhere else
        state = replace(state, is_unchecked=True, checked=None, searching=None, fits=0)
    suspicious = agreement.fit < state.usual_fit - SUSPICIOUS_DROP
    state = replace(
        state,
        usual_fit=(1 - USUAL_SHARE) * state.usual_fit + USUAL_SHARE * agreement.fit,
        fits=state.fits + 1 if agreement.fit >= CONFIRMED_FIT else 0,
        misfits=state.misfits + 1 if suspicious else 0,
        misfit_since_s=None,
    )
    if state.state is PoseState.LOCALIZED and not state.is_unchecked:
        return doubt_pose(state, agreement, odometry, stamp_s)
    confirmed = state.fits >= CONFIRMED_SCANS and is_sure(track.estimate) and not state.is_unchecked
    if state.state is PoseState.UNCERTAIN and confirmed:
        return on_event(state, PoseEvent.FITS), PoseEvent.FITS
    return state, None


def _look(
    map_: LocalizationMap,
    state: Localization,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
    *,
    auto_search: bool,
) -> tuple[Localization, PoseEvent | None]:
    """Search everywhere, a bit further with each scan."""
    last = state.searching
    if state.state is not PoseState.SEARCHING:
        due = last is None or search_room.is_due(last, odometry, stamp_s)
        if not (auto_search and due):
            return state, None
        begun = search_room.start_search(map_, scan, odometry, stamp_s)
        return on_event(replace(state, searching=begun), PoseEvent.SEARCH_STARTED), PoseEvent.SEARCH_STARTED
    if last is None:
        last = search_room.start_search(map_, scan, odometry, stamp_s)
    else:
        last = search_room.add_scan(map_, last, odometry, scan)
    last = search_room.advance_search(map_, last, odometry)
    event, place = _result(last, odometry, stamp_s)
    if event is PoseEvent.SEARCH_STARTED:
        last = search_room.start_search(map_, scan, odometry, stamp_s, last.candidates)
    state = replace(state, searching=last)
    if place is not None:
        state = replace(
            forgotten(state),
            estimate=place.estimate,
            usual_fit=place.fit,
            checked=(odometry, place.fit),
            fit=place.fit,
            overlap=place.overlap,
        )
    return (state, None) if event is None else (on_event(state, event), event)


def _result(
    searching: Searching, odometry: Floats, stamp_s: float
) -> tuple[PoseEvent | None, Hypothesis | None]:
    """What a search says by now: ``found`` (at which place), ``not_found``, or ``search_started`` if it begins again.

    Candidates of an earlier search count while the next one is under way.
    """
    candidates = searching.candidates
    best = sure(candidates, is_complete=searching.is_complete)
    if best is not None:
        return PoseEvent.FOUND, best
    if searching.search is not None:
        return None, None
    badly = not candidates or candidates[0].fit < MOVING_FIT
    if badly and (not candidates or stamp_s - searching.began_s >= SETTLE_S):
        return PoseEvent.NOT_FOUND, None
    if (badly or not searching.is_complete) and search_room.has_moved_on(searching, odometry):
        return PoseEvent.SEARCH_STARTED, None
    return None, None


def _update_published(state: Localization, stamp_s: float) -> tuple[Localization, bool]:
    """The ``map_from_odom`` to publish: it follows the estimate, and stays as it was where there is none."""
    if state.estimate is None or state.odometry is None:
        return state, False
    odometry, pose = state.odometry.pose, state.estimate.pose
    if state.published is None:
        published, jumped = compose(pose, inverse(odometry)), True
    else:
        dt_s = max(stamp_s - state.published_s, 0.0)
        published, jumped = correct_odom(state.published, pose, odometry, dt_s)
    return replace(state, published=published, published_s=stamp_s), jumped


def _report(state: Localization, stamp_s: float, event: PoseEvent | None, jumped: bool) -> LocalizationReport:
    searching = None if state.state in HAS_POSE else state.searching
    candidates = () if searching is None else likely(searching.candidates)
    has_pose = state.state in HAS_POSE
    return LocalizationReport(
        stamp_s=stamp_s,
        state=state.state,
        event=event,
        map_from_base=state.estimate if has_pose else None,
        map_from_odom=state.published,
        jumped=jumped,
        fit=state.fit if has_pose else max((one.fit for one in candidates), default=0.0),
        overlap=state.overlap if has_pose else max((one.overlap for one in candidates), default=0.0),
        alternatives=candidates,
        searched=0.0 if searching is None else searching.share_done,
    )
