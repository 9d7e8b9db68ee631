"""Localization as one pure step per scan: tracks a known pose, and searches for an unknown one.

Values in, values out: the time is an argument, nothing is left to chance, and no step takes long, because a search of
the whole map goes on from step to step.
"""

import math
from typing import Final

import numpy as np

from chefbotd.core.record import Record, replace
from chefbotd.localization import searching as search_room
from chefbotd.localization.agreement import Agreement
from chefbotd.localization.global_search import is_same
from chefbotd.localization.hypotheses import REFUTED_BY, Hypothesis, likely, merged, moved
from chefbotd.localization.searching import LocalizationMap, Searching
from chefbotd.localization.smoothing import corrected
from chefbotd.localization.states import HAS_POSE, NEXT, Event, State
from chefbotd.localization.tracking import (
    MIN_OVERLAP,
    SUSPICIOUS_DROP,
    Estimate,
    motion_covariance,
    predicted,
    sigmas,
    tracked,
)
from chefbotd.mapping.poses import Floats, between, compose, inverse
from chefbotd.mapping.state import Scan

USUAL_SHARE = 0.05
"""What a scan counts in the usual fit."""

LOOK_AROUND_EVERY = 3
"""Of scans that fit badly in a row, every third is searched further around: that takes long."""


UNCERTAIN_AFTER_S: Final = 0.5
LOST_AFTER_S: Final = 1.5
LOST_AFTER_SCANS: Final = 5
"""A pose is given up when its scans misfit for so long, and are so many."""

WEAK_FIT: Final = 0.6
WEAK_AFTER_S: Final = 20.0
"""A pose whose scans fit worse than this is uncertain as well, and given up after so long."""

NO_EVIDENCE_AFTER_S: Final = 10.0
"""An uncertain pose from which nothing is seen that the map knows is given up after so long."""

CONFIRMED_FIT: Final = 0.65
CONFIRMED_SCANS: Final = 3
"""So many scans in a row that fit so well end a doubt."""

MAX_SIGMA_M: Final = 0.5
MAX_SIGMA_RAD: Final = 0.5
"""An estimate that is less sure than this is uncertain, whatever fits."""

CONTRADICTED_BY: Final = 0.08
"""A pose that was given is given up where another fits so much better; half of it is too much to confirm it."""

FIXED_SIGMA_M: Final = 0.1
"""A pose that was given is not confirmed while the scans leave it open by more, as along a bare corridor."""

DOUBTED_FIT: Final = 0.76
"""A pose that fits worse than this is uncertain until the whole map has been searched for a better place."""

DOUBTED_THROUGH: Final = 0.12
"""So large a share of beams through walls of the map has it searched as well: no person and no added chair does this."""

DOUBTED_AGAIN_M: Final = 2.0
"""After such a search it is not searched again for so far, unless the fit drops further."""

GIVEN_SIGMA_M: Final = 0.3
GIVEN_SIGMA_RAD: Final = 0.2
"""One sigma of a pose that a person gives."""


class Odometry(Record, frozen=True):
    """``odom_from_base`` at the scan's stamp; its covariance (3, 3) in ``odom``, if the odometry tells one."""

    pose: Floats
    covariance: Floats | None = None


class Localization(Record, frozen=True):
    """All that the next step needs; ``published`` is the last ``map_from_odom``, of the time ``published_s``.

    ``misfits`` counts scans in a row that fit badly or worse than usual, ``fits`` those that fit well. Since
    ``no_evidence_since_s`` scans have seen nothing that the map knows. A pose that was given, or
    whose scans have contradicted the map since ``doubted_since_s``, ``is_unchecked`` until the whole map has been
    searched for a place that fits better. ``checked`` is where the odometry was at the end of it, and the fit.
    """

    state: State = State.UNKNOWN
    estimate: Estimate | None = None
    odometry: Odometry | None = None
    searching: Searching | None = None
    usual_fit: float = 1.0
    fit: float = 0.0
    overlap: float = 0.0
    misfits: int = 0
    misfit_since_s: float | None = None
    no_evidence_since_s: float | None = None
    fits: int = 0
    published: Floats | None = None
    published_s: float = 0.0
    is_unchecked: bool = False
    doubted_since_s: float | None = None
    checked: tuple[Floats, float] | None = None


class Report(Record, frozen=True):
    """What a step found: ``map_from_base`` is None while there is no one pose.

    ``map_from_odom`` follows it smoothly; where it could not, ``jumped`` says so. While it searches or is lost,
    ``alternatives`` are where the robot may well be, and ``searched`` is the share of the search that is done.
    """

    stamp_s: float
    state: State
    event: Event | None
    map_from_base: Estimate | None
    map_from_odom: Floats | None
    jumped: bool
    fit: float
    overlap: float
    alternatives: tuple[Hypothesis, ...]
    searched: float


def set_pose(now: Localization, pose: Floats, covariance: Floats | None = None) -> Localization:
    """The robot is about here, says a person or what was kept before a restart; the next scans confirm it or not.

    Raises:
        ValueError: the pose is not three finite numbers.
    """
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"a pose is x, y and heading, got {pose.tolist()}")
    vague = np.diag([GIVEN_SIGMA_M**2, GIVEN_SIGMA_M**2, GIVEN_SIGMA_RAD**2])
    estimate = Estimate(pose.astype(np.float64), vague if covariance is None else covariance)
    return _on(replace(_forgotten(now), estimate=estimate, is_unchecked=True), Event.POSE_GIVEN)


def localize(now: Localization) -> Localization:
    """Search everywhere, whatever is known."""
    return _on(_forgotten(now), Event.SEARCH_STARTED)


def _forgotten(now: Localization) -> Localization:
    return Localization(
        state=now.state, odometry=now.odometry, published=now.published, published_s=now.published_s
    )


def _on(now: Localization, event: Event) -> Localization:
    return replace(now, state=NEXT[now.state, event])


def step(
    within: LocalizationMap,
    now: Localization,
    stamp_s: float,
    odometry: Odometry,
    scan: Scan | None,
    *,
    auto_search: bool = True,
) -> tuple[Localization, Report]:
    """Take a scan into account (None: there is only odometry).

    With ``auto_search`` a robot that is lost searches without being asked to.
    """
    now, event = _carried(now, odometry), None
    if scan is not None and len(scan.points):
        if now.state in HAS_POSE and now.estimate is not None:
            now, event = _follow(within, now, now.estimate, odometry.pose, stamp_s, scan)
            if now.is_unchecked and event is None:
                now, event = _checked(within, now, odometry.pose, stamp_s, scan)
        else:
            now, event = _look(within, now, odometry.pose, stamp_s, scan, auto_search=auto_search)
    if now.state is State.LOCALIZED and now.estimate is not None and not _is_sure(now.estimate):
        now, event = _on(now, Event.MISFITS), Event.MISFITS
    now, jumped = _published(now, stamp_s)
    return now, _report(now, stamp_s, event, jumped)


def advanced(within: LocalizationMap, now: Localization) -> Localization:
    """Go on with a search between two scans, a bounded bit."""
    if now.searching is None or now.odometry is None:
        return now
    if now.state is not State.SEARCHING and not now.is_unchecked:
        return now
    pose = now.odometry.pose
    return replace(now, searching=search_room.advanced(within, now.searching, pose))


def _carried(now: Localization, odometry: Odometry) -> Localization:
    """The estimate and all candidates after the motion since the last step."""
    if now.odometry is None:
        return replace(now, odometry=odometry)
    motion = between(now.odometry.pose, odometry.pose)
    noise = _noise(now.odometry, odometry)
    now = replace(now, odometry=odometry)
    if not motion.any():
        return now
    if now.estimate is not None:
        now = replace(now, estimate=predicted(now.estimate, motion, noise))
    if now.searching is not None and now.searching.candidates:
        candidates = moved(now.searching.candidates, motion, noise)
        now = replace(now, searching=replace(now.searching, candidates=candidates))
    return now


def _noise(before: Odometry, after: Odometry) -> Floats | None:
    """The covariance of the motion, if the odometry tells one that makes sense: it began anew if it has shrunk."""
    if before.covariance is None or after.covariance is None:
        return None
    noise = motion_covariance(before.pose, before.covariance, after.pose, after.covariance)
    return noise if np.linalg.eigvalsh(noise)[0] > -1e-9 else None


def _follow(
    within: LocalizationMap,
    now: Localization,
    expected: Estimate,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, Event | None]:
    """Match the scan about the estimate, and count whether scans fit."""
    around = now.misfits % LOOK_AROUND_EVERY == 0
    grids = within.surfaces.grids
    track = tracked(grids, expected, scan, now.usual_fit, may_search=around)
    agreement = track.agreement
    now = replace(now, estimate=track.estimate, fit=agreement.fit, overlap=agreement.overlap)
    if agreement.overlap < MIN_OVERLAP:
        return _without_evidence(now, stamp_s)
    now = replace(now, no_evidence_since_s=None)
    if not track.matched or agreement.fit < WEAK_FIT:
        patience_s = WEAK_AFTER_S if track.matched else LOST_AFTER_S
        return _misfit(now, stamp_s, patience_s)
    suspicious = agreement.fit < now.usual_fit - SUSPICIOUS_DROP
    now = replace(
        now,
        usual_fit=(1 - USUAL_SHARE) * now.usual_fit + USUAL_SHARE * agreement.fit,
        fits=now.fits + 1 if agreement.fit >= CONFIRMED_FIT else 0,
        misfits=now.misfits + 1 if suspicious else 0,
        misfit_since_s=None,
    )
    if now.state is State.LOCALIZED and not now.is_unchecked:
        return _doubted(now, agreement, odometry, stamp_s)
    confirmed = now.fits >= CONFIRMED_SCANS and _is_sure(track.estimate) and not now.is_unchecked
    if now.state is State.UNCERTAIN and confirmed:
        return _on(now, Event.FITS), Event.FITS
    return now, None


def _doubted(
    now: Localization, agreement: Agreement, odometry: Floats, stamp_s: float
) -> tuple[Localization, Event | None]:
    """Have the whole map searched when scans contradict a pose for a while; where much does not fit, it is uncertain."""
    fits_badly = agreement.fit < DOUBTED_FIT
    if not fits_badly and agreement.contradiction <= DOUBTED_THROUGH:
        return replace(now, doubted_since_s=None), None
    if now.checked is not None:
        before, fit = now.checked
        motion = between(before, odometry)
        is_near = math.hypot(motion[0], motion[1]) < DOUBTED_AGAIN_M
        if is_near and agreement.fit >= fit - SUSPICIOUS_DROP:
            return now, None
    since_s = stamp_s if now.doubted_since_s is None else now.doubted_since_s
    now = replace(now, doubted_since_s=since_s)
    if stamp_s - since_s < UNCERTAIN_AFTER_S:
        return now, None
    now = replace(now, is_unchecked=True, doubted_since_s=None, searching=None)
    return (_on(now, Event.MISFITS), Event.MISFITS) if fits_badly else (now, None)


def _checked(
    within: LocalizationMap,
    now: Localization,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, Event | None]:
    """Search the whole map, a bit further with each scan, for a place that contradicts a pose that is unchecked.

    A pose that was given is given up where another fits clearly better; one that was believed before, only where a
    search would refute it, because furniture that was moved costs the right place as much. It is as good as found where
    none does, and where the scans tell where it is in every direction: along a bare corridor they do not.
    """
    last, estimate = now.searching, now.estimate
    if estimate is None or now.overlap < MIN_OVERLAP:
        return now, None
    if last is None or _is_due_again(last, odometry):
        candidates = () if last is None else last.candidates
        last = search_room.begun(within, scan, odometry, stamp_s, candidates)
    else:
        last = search_room.looked(within, last, odometry, scan)
    was_searched = last.search is None
    last = search_room.advanced(within, last, odometry)
    if last.search is None and not was_searched:
        given = Hypothesis(estimate, now.fit, now.overlap)
        last = replace(last, candidates=merged((given,), last.candidates))
    now = replace(now, searching=last)
    if last.search is not None:
        return now, None
    best = max((one.fit for one in last.candidates), default=0.0)
    own = max((one.fit for one in last.candidates if _is_at(one, estimate)), default=now.fit)
    scans = min((one.scans for one in last.candidates), default=0)
    was_found = now.checked is not None
    if own <= best - (REFUTED_BY if was_found else CONTRADICTED_BY):
        return _given_up(now), Event.GIVEN_UP
    if scans < 2:
        return now, None
    is_fixed = was_found or sigmas(estimate.covariance)[0] <= FIXED_SIGMA_M
    if own <= best - CONTRADICTED_BY / 2 or not is_fixed:
        is_doubted = now.state is State.LOCALIZED
        return (_on(now, Event.MISFITS), Event.MISFITS) if is_doubted else (now, None)
    now = replace(now, searching=None, is_unchecked=False, checked=(odometry, now.fit))
    if now.state is State.UNCERTAIN and now.fits >= CONFIRMED_SCANS and _is_sure(estimate):
        return _on(now, Event.FITS), Event.FITS
    return now, None


def _is_due_again(last: Searching, odometry: Floats) -> bool:
    """Whether there were too many places to follow all, and the robot sees others now."""
    return last.search is None and not last.is_complete and search_room.has_moved_on(last, odometry)


def _is_at(one: Hypothesis, estimate: Estimate) -> bool:
    return is_same(one.estimate.pose, estimate.pose)


def _without_evidence(now: Localization, stamp_s: float) -> tuple[Localization, Event | None]:
    """An uncertain pose in space that the map does not know is carried by odometry for a while, and then given up."""
    since_s = stamp_s if now.no_evidence_since_s is None else now.no_evidence_since_s
    now = replace(now, no_evidence_since_s=since_s)
    if now.state is State.UNCERTAIN and stamp_s - since_s >= NO_EVIDENCE_AFTER_S:
        return _given_up(now), Event.GIVEN_UP
    return now, None


def _misfit(now: Localization, stamp_s: float, patience_s: float) -> tuple[Localization, Event | None]:
    since_s = stamp_s if now.misfit_since_s is None else now.misfit_since_s
    misfits = 1 if now.misfit_since_s is None else now.misfits + 1
    now = replace(now, misfit_since_s=since_s, misfits=misfits, fits=0)
    if stamp_s - since_s >= patience_s and misfits >= LOST_AFTER_SCANS:
        return _given_up(now), Event.GIVEN_UP
    if stamp_s - since_s >= UNCERTAIN_AFTER_S and now.state is State.LOCALIZED:
        return _on(now, Event.MISFITS), Event.MISFITS
    return now, None


def _given_up(now: Localization) -> Localization:
    return replace(_on(now, Event.GIVEN_UP), estimate=None, searching=None, is_unchecked=False)


def _is_sure(estimate: Estimate) -> bool:
    sigma_m, sigma_rad = sigmas(estimate.covariance)
    return sigma_m <= MAX_SIGMA_M and sigma_rad <= MAX_SIGMA_RAD


def _look(
    within: LocalizationMap,
    now: Localization,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
    *,
    auto_search: bool,
) -> tuple[Localization, Event | None]:
    """Search everywhere, a bit further with each scan."""
    last = now.searching
    if now.state is not State.SEARCHING:
        due = last is None or search_room.is_due(last, odometry, stamp_s)
        if not (auto_search and due):
            return now, None
        begun = search_room.begun(within, scan, odometry, stamp_s)
        return _on(replace(now, searching=begun), Event.SEARCH_STARTED), Event.SEARCH_STARTED
    if last is None:
        last = search_room.begun(within, scan, odometry, stamp_s)
    else:
        last = search_room.looked(within, last, odometry, scan)
    last = search_room.advanced(within, last, odometry)
    result = search_room.result(last, odometry, stamp_s)
    event, place = result.event, result.place
    if event is Event.SEARCH_STARTED:
        last = search_room.begun(within, scan, odometry, stamp_s, last.candidates)
    now = replace(now, searching=last)
    if place is not None:
        now = replace(
            _forgotten(now),
            estimate=place.estimate,
            usual_fit=place.fit,
            checked=(odometry, place.fit),
            fit=place.fit,
            overlap=place.overlap,
        )
    return (now, None) if event is None else (_on(now, event), event)


def _published(now: Localization, stamp_s: float) -> tuple[Localization, bool]:
    """The ``map_from_odom`` to publish: it follows the estimate, and stays as it was where there is none."""
    if now.estimate is None or now.odometry is None:
        return now, False
    odometry, pose = now.odometry.pose, now.estimate.pose
    if now.published is None:
        published, jumped = compose(pose, inverse(odometry)), True
    else:
        dt_s = max(stamp_s - now.published_s, 0.0)
        published, jumped = corrected(now.published, pose, odometry, dt_s)
    return replace(now, published=published, published_s=stamp_s), jumped


def _report(now: Localization, stamp_s: float, event: Event | None, jumped: bool) -> Report:
    searching = None if now.state in HAS_POSE else now.searching
    candidates = () if searching is None else likely(searching.candidates)
    has_pose = now.state in HAS_POSE
    return Report(
        stamp_s=stamp_s,
        state=now.state,
        event=event,
        map_from_base=now.estimate if has_pose else None,
        map_from_odom=now.published,
        jumped=jumped,
        fit=now.fit if has_pose else max((one.fit for one in candidates), default=0.0),
        overlap=now.overlap if has_pose else max((one.overlap for one in candidates), default=0.0),
        alternatives=candidates,
        searched=0.0 if searching is None else searching.share_done,
    )
