"""Localization as one pure step per scan: tracks a known pose, and searches for an unknown one.

Values in, values out: the time is an argument, nothing is left to chance, and no step takes long, because a search of
the whole map goes on from step to step.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from chefbotd.localization import searching as search_room
from chefbotd.localization.hypotheses import Hypothesis, likely, moved
from chefbotd.localization.parameters import LocalizationParameters, WatchParameters
from chefbotd.localization.searching import LocalizationMap, Searching
from chefbotd.localization.smoothing import corrected
from chefbotd.localization.states import HAS_POSE, NEXT, Event, State
from chefbotd.localization.tracking import Estimate, motion_covariance, predicted, sigmas, tracked
from chefbotd.mapping.poses import Floats, between, compose, inverse
from chefbotd.mapping.state import Scan

USUAL_SHARE = 0.05
"""What a scan counts in the usual fit."""

LOOK_AROUND_EVERY = 3
"""Of scans that fit badly in a row, every third is searched further around: that takes long."""


class Odometry(NamedTuple):
    """``odom_from_base`` at the scan's stamp; its covariance (3, 3) in ``odom``, if the odometry tells one."""

    pose: Floats
    covariance: Floats | None = None


@dataclass(frozen=True, slots=True)
class Localization:
    """All that the next step needs; ``told`` is ``map_from_odom`` as it was told last, at ``told_s``.

    ``misfits`` counts scans in a row that fit badly or worse than usual, ``fits`` those that fit well. Since
    ``no_evidence_since_s`` scans have seen nothing that the map knows.
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
    told: Floats | None = None
    told_s: float = 0.0


class Report(NamedTuple):
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


def set_pose(
    params: LocalizationParameters, now: Localization, pose: Floats, covariance: Floats | None = None
) -> Localization:
    """The robot is about here, says a person or what was kept before a restart; the next scans confirm it or not.

    Raises:
        ValueError: the pose is not three finite numbers.
    """
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"a pose is x, y and heading, got {pose.tolist()}")
    watch = params.watch
    vague = np.diag([watch.given_m**2, watch.given_m**2, watch.given_rad**2])
    estimate = Estimate(pose.astype(np.float64), vague if covariance is None else covariance)
    return _on(replace(_forgotten(now), estimate=estimate), Event.POSE_GIVEN)


def localize(now: Localization) -> Localization:
    """Search everywhere, whatever is known."""
    return _on(_forgotten(now), Event.SEARCH_STARTED)


def _forgotten(now: Localization) -> Localization:
    return Localization(state=now.state, odometry=now.odometry, told=now.told, told_s=now.told_s)


def _on(now: Localization, event: Event) -> Localization:
    return replace(now, state=NEXT[now.state, event])


def step(
    params: LocalizationParameters,
    within: LocalizationMap,
    now: Localization,
    stamp_s: float,
    odometry: Odometry,
    scan: Scan | None,
) -> tuple[Localization, Report]:
    """Take a scan into account (None: there is only odometry)."""
    now, event = _carried(params, now, odometry), None
    if scan is not None and len(scan.points):
        if now.state in HAS_POSE and now.estimate is not None:
            now, event = _follow(params, within, now, now.estimate, stamp_s, scan)
        else:
            now, event = _look(params, within, now, odometry.pose, stamp_s, scan)
    if now.state is State.LOCALIZED and now.estimate is not None and not _is_sure(params.watch, now.estimate):
        now, event = _on(now, Event.MISFITS), Event.MISFITS
    now, jumped = _told(params, now, stamp_s)
    return now, _report(params, now, stamp_s, event, jumped)


def advanced(params: LocalizationParameters, within: LocalizationMap, now: Localization) -> Localization:
    """Go on with a search between two scans, a bounded bit."""
    if now.searching is None or now.odometry is None or now.state is not State.SEARCHING:
        return now
    pose = now.odometry.pose
    return replace(now, searching=search_room.advanced(params.for_search, within, now.searching, pose))


def _carried(params: LocalizationParameters, now: Localization, odometry: Odometry) -> Localization:
    """The estimate and all candidates after the motion since the last step."""
    if now.odometry is None:
        return replace(now, odometry=odometry)
    motion = between(now.odometry.pose, odometry.pose)
    noise = _noise(now.odometry, odometry)
    now = replace(now, odometry=odometry)
    if not motion.any():
        return now
    if now.estimate is not None:
        now = replace(now, estimate=predicted(params.tracking, now.estimate, motion, noise))
    if now.searching is not None and now.searching.candidates:
        candidates = moved(params.tracking, now.searching.candidates, motion, noise)
        now = replace(now, searching=replace(now.searching, candidates=candidates))
    return now


def _noise(before: Odometry, after: Odometry) -> Floats | None:
    """The covariance of the motion, if the odometry tells one that makes sense: it began anew if it has shrunk."""
    if before.covariance is None or after.covariance is None:
        return None
    noise = motion_covariance(before.pose, before.covariance, after.pose, after.covariance)
    return noise if np.linalg.eigvalsh(noise)[0] > -1e-9 else None


def _follow(
    params: LocalizationParameters,
    within: LocalizationMap,
    now: Localization,
    expected: Estimate,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, Event | None]:
    """Match the scan about the estimate, and count whether scans fit."""
    tracking, watch = params.tracking, params.watch
    around = now.misfits % LOOK_AROUND_EVERY == 0
    grids = within.surfaces.grids
    found = tracked(tracking, grids, expected, scan, now.usual_fit, may_search=around)
    told = found.agreement
    now = replace(now, estimate=found.estimate, fit=told.fit, overlap=told.overlap)
    if told.overlap < tracking.min_overlap:
        return _without_evidence(watch, now, stamp_s)
    now = replace(now, no_evidence_since_s=None)
    if not found.matched or told.fit < watch.weak_fit:
        patience_s = watch.weak_after_s if found.matched else watch.lost_after_s
        return _misfit(watch, now, stamp_s, patience_s)
    suspicious = told.fit < now.usual_fit - tracking.suspicious_drop
    now = replace(
        now,
        usual_fit=(1 - USUAL_SHARE) * now.usual_fit + USUAL_SHARE * told.fit,
        fits=now.fits + 1 if told.fit >= watch.confirmed_fit else 0,
        misfits=now.misfits + 1 if suspicious else 0,
        misfit_since_s=None,
    )
    confirmed = now.fits >= watch.confirmed_scans and _is_sure(watch, found.estimate)
    if now.state is State.UNCERTAIN and confirmed:
        return _on(now, Event.FITS), Event.FITS
    return now, None


def _without_evidence(
    watch: WatchParameters, now: Localization, stamp_s: float
) -> tuple[Localization, Event | None]:
    """An uncertain pose in space that the map does not know is carried by odometry for a while, and then given up."""
    since_s = stamp_s if now.no_evidence_since_s is None else now.no_evidence_since_s
    now = replace(now, no_evidence_since_s=since_s)
    if now.state is State.UNCERTAIN and stamp_s - since_s >= watch.no_evidence_after_s:
        return replace(_on(now, Event.GIVEN_UP), estimate=None, searching=None), Event.GIVEN_UP
    return now, None


def _misfit(
    watch: WatchParameters, now: Localization, stamp_s: float, patience_s: float
) -> tuple[Localization, Event | None]:
    since_s = stamp_s if now.misfit_since_s is None else now.misfit_since_s
    misfits = 1 if now.misfit_since_s is None else now.misfits + 1
    now = replace(now, misfit_since_s=since_s, misfits=misfits, fits=0)
    if stamp_s - since_s >= patience_s and misfits >= watch.lost_after_scans:
        return replace(_on(now, Event.GIVEN_UP), estimate=None, searching=None), Event.GIVEN_UP
    if stamp_s - since_s >= watch.uncertain_after_s and now.state is State.LOCALIZED:
        return _on(now, Event.MISFITS), Event.MISFITS
    return now, None


def _is_sure(watch: WatchParameters, estimate: Estimate) -> bool:
    sigma_m, sigma_rad = sigmas(estimate.covariance)
    return sigma_m <= watch.max_sigma_m and sigma_rad <= watch.max_sigma_rad


def _look(
    params: LocalizationParameters,
    within: LocalizationMap,
    now: Localization,
    odometry: Floats,
    stamp_s: float,
    scan: Scan,
) -> tuple[Localization, Event | None]:
    """Search everywhere, a bit further with each scan."""
    settings, last = params.for_search, now.searching
    if now.state is not State.SEARCHING:
        due = last is None or search_room.is_due(settings.searching, last, odometry, stamp_s)
        if not (settings.searching.by_itself and due):
            return now, None
        begun = search_room.begun(settings, within, scan, odometry, stamp_s)
        return _on(replace(now, searching=begun), Event.SEARCH_STARTED), Event.SEARCH_STARTED
    if last is None:
        last = search_room.begun(settings, within, scan, odometry, stamp_s)
    else:
        last = search_room.looked(settings, within, last, odometry, scan)
    last = search_room.advanced(settings, within, last, odometry)
    event, found = search_room.verdict(settings, last, odometry, stamp_s)
    if event is Event.SEARCH_STARTED:
        last = search_room.begun(settings, within, scan, odometry, stamp_s, last.candidates)
    now = replace(now, searching=last)
    if found is not None:
        now = replace(
            _forgotten(now),
            estimate=found.estimate,
            usual_fit=found.fit,
            fit=found.fit,
            overlap=found.overlap,
        )
    return (now, None) if event is None else (_on(now, event), event)


def _told(params: LocalizationParameters, now: Localization, stamp_s: float) -> tuple[Localization, bool]:
    """``map_from_odom`` as it is told now: it follows the estimate, and stays as it was where there is none."""
    if now.estimate is None or now.odometry is None:
        return now, False
    odometry, pose = now.odometry.pose, now.estimate.pose
    if now.told is None:
        told, jumped = compose(pose, inverse(odometry)), True
    else:
        dt_s = max(stamp_s - now.told_s, 0.0)
        told, jumped = corrected(params.smoothing, now.told, pose, odometry, dt_s)
    return replace(now, told=told, told_s=stamp_s), jumped


def _report(
    params: LocalizationParameters, now: Localization, stamp_s: float, event: Event | None, jumped: bool
) -> Report:
    searching = None if now.state in HAS_POSE else now.searching
    candidates = () if searching is None else likely(params.certainty, searching.candidates)
    has_pose = now.state in HAS_POSE
    return Report(
        stamp_s=stamp_s,
        state=now.state,
        event=event,
        map_from_base=now.estimate if has_pose else None,
        map_from_odom=now.told,
        jumped=jumped,
        fit=now.fit if has_pose else max((one.fit for one in candidates), default=0.0),
        overlap=now.overlap if has_pose else max((one.overlap for one in candidates), default=0.0),
        alternatives=candidates,
        searched=0.0 if searching is None else searching.share_done,
    )
