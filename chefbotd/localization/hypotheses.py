"""Follows all possible places of the robot until only one is left.

A place is refuted when its scans do not fit, or fit clearly worse than at another place. Places that fit nearly as
well all stay: a chair that was moved costs the right room more than its look-alike.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.localization.agreement import agreement
from chefbotd.localization.global_search import GlobalSearchParameters, Place, is_same
from chefbotd.localization.tracking import Estimate, TrackingParameters, predicted, sigmas, tracked
from chefbotd.mapping.local_map import LocalMap
from chefbotd.mapping.poses import Floats
from chefbotd.mapping.refine import Prior, polish
from chefbotd.mapping.state import Scan

PLACE_M, PLACE_RAD = 0.15, 0.08
"""One sigma of a place that a search found, before its scan is polished."""


class CertaintyParameters(Parameters):
    """When one place is believed to be the right one."""

    least_fit: float = Field(default=0.5, gt=0, le=1)
    """A place whose scans fit worse is refuted."""
    refuted_by: float = Field(default=0.2, gt=0, le=1)
    """So is one that fits so much worse than the best."""
    rival_within: float = Field(default=0.1, gt=0, le=1)
    """While another place fits worse by less than this, none is sure."""
    sure_fit: float = Field(default=0.88, gt=0, le=1)
    """What fits so well is sure after some scans, even without motion."""
    moving_fit: float = Field(default=0.75, gt=0, le=1)
    """What fits so well is sure after having been seen so from several places."""
    scans: int = Field(default=4, ge=1, le=100)
    looks: int = Field(default=8, ge=2, le=100)
    look_m: float = Field(default=0.2, gt=0, le=5)
    look_rad: float = Field(default=0.5, gt=0, le=3.2)
    """After so much motion a scan is another look."""
    min_overlap: float = Field(default=0.5, ge=0, le=1)
    vague_m: float = Field(default=0.3, gt=0, le=5)
    """What a scan leaves open by more, as along a bare corridor, is not sure."""


class Hypothesis(NamedTuple):
    """A place where the robot might be: how well its scans fit (smoothed), and how many, from how many places."""

    estimate: Estimate
    fit: float
    overlap: float
    scans: int = 1
    looks: int = 1


FIT_SHARE = 0.3
"""What the newest scan counts in the smoothed fit."""


def hypotheses(
    params: CertaintyParameters,
    tracking: TrackingParameters,
    grids: LocalMap,
    places: tuple[Place, ...],
    scan: Scan,
) -> tuple[Hypothesis, ...]:
    """The places that the scan they were found for fits, once it is polished."""
    vague = np.diag([PLACE_M**2, PLACE_M**2, PLACE_RAD**2])
    found = []
    for place in places:
        prior = Prior(place.pose, np.linalg.inv(vague))
        fit = polish(grids, scan.points, scan.facing, place.pose, prior, tracking.laser_noise_m)
        told = agreement(grids, fit.pose, scan)
        if told.fit >= params.least_fit:
            found.append(Hypothesis(Estimate(fit.pose, vague), told.fit, told.overlap))
    return tuple(sorted(found, key=lambda one: -one.fit))


def moved(
    tracking: TrackingParameters, among: tuple[Hypothesis, ...], motion: Floats, noise: Floats | None
) -> tuple[Hypothesis, ...]:
    """All places after a motion."""
    return tuple(one._replace(estimate=predicted(tracking, one.estimate, motion, noise)) for one in among)


def confronted(
    params: CertaintyParameters,
    tracking: TrackingParameters,
    grids: LocalMap,
    among: tuple[Hypothesis, ...],
    scan: Scan,
    *,
    is_look: bool,
) -> tuple[Hypothesis, ...]:
    """What is left after a scan, the best first; ``is_look`` says that the robot has moved since the last look."""
    seen = []
    for one in among:
        found = tracked(tracking, grids, one.estimate, scan, may_search=False)
        fit = (1 - FIT_SHARE) * one.fit + FIT_SHARE * found.agreement.fit
        seen.append(
            Hypothesis(found.estimate, fit, found.agreement.overlap, one.scans + 1, one.looks + int(is_look))
        )
    best = max((one.fit for one in seen), default=0.0)
    least = max(params.least_fit, best - params.refuted_by)
    return merged((), tuple(one for one in seen if one.fit >= least))


def merged(old: tuple[Hypothesis, ...], new: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
    """Both, the best first, without those of the new that are the same as one before."""
    kept = list(old)
    for one in sorted(new, key=lambda one: -one.fit):
        if not any(is_same(APART, one.estimate.pose, other.estimate.pose) for other in kept):
            kept.append(one)
    return tuple(sorted(kept, key=lambda one: -one.fit))


APART = GlobalSearchParameters()


def is_look(params: CertaintyParameters, motion: Floats) -> bool:
    """Whether so much motion makes another look."""
    return math.hypot(motion[0], motion[1]) >= params.look_m or abs(float(motion[2])) >= params.look_rad


def likely(params: CertaintyParameters, among: tuple[Hypothesis, ...]) -> tuple[Hypothesis, ...]:
    """The places that fit as well as the best, or nearly: where the robot may well be."""
    return tuple(one for one in among if one.fit > among[0].fit - params.rival_within)


def sure(
    params: CertaintyParameters, among: tuple[Hypothesis, ...], *, is_complete: bool
) -> Hypothesis | None:
    """The place that is believed, if there is one; the best is first.

    If there were more places than can be followed (not ``is_complete``), only motion makes one sure.
    """
    if not among:
        return None
    best = among[0]
    if len(likely(params, among)) > 1:
        return None
    if best.overlap < params.min_overlap or sigmas(best.estimate.covariance)[0] > params.vague_m:
        return None
    standing = is_complete and best.fit >= params.sure_fit and best.scans >= params.scans
    moving = best.fit >= params.moving_fit and best.looks >= params.looks
    return best if standing or moving else None
